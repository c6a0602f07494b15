"""A sweep through a work pool: every object is a run of the deployment `dream`, taken by whichever machine's worker is free."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId, FlowRunFilterTags
from prefect.client.schemas.objects import FlowRun
from prefect.deployments import run_deployment
from prefect.logging import get_run_logger
from prefect.states import Cancelling

from flows.sweep_plan import Cell, Plan

DEPLOYMENT = "dream/dream"
SECONDS = 3.0
"""Between two looks at the runs."""
PAGE = 200
"""Runs asked for at once; Prefect gives no more."""


def through_pool(plan: Plan, cells: Sequence[Cell]) -> dict[str, str]:
    """Have every object dreamed by the workers of the pool; by key, the sentences of those that failed.

    Runs that an earlier conductor of the same sweep has left behind are cancelled first: what they had done is in the store. When this
    one is stopped it cancels its own.
    """
    tag = f"sweep:{plan.name}"
    with get_client(sync_client=True) as client:
        _cancel(client, _unfinished(client, FlowRunFilter(tags=FlowRunFilterTags(all_=[tag]))))
        waiting: dict[UUID, Cell] = {}
        try:
            for cell in cells:
                run = run_deployment(DEPLOYMENT, parameters=cell.parameters, timeout=0, tags=[tag], flow_run_name=cell.name)
                assert isinstance(run, FlowRun)
                waiting[run.id] = cell
            return _wait(client, waiting)
        except BaseException:
            _cancel(client, _unfinished(client, FlowRunFilter(tags=FlowRunFilterTags(all_=[tag]))))
            raise


def _wait(client: SyncPrefectClient, waiting: dict[UUID, Cell]) -> dict[str, str]:
    """Until each run has ended, one way or the other; one that somebody has deleted has ended too."""
    errors: dict[str, str] = {}
    while waiting:
        deleted = set(waiting)
        for run in _runs(client, list(waiting)):
            deleted.discard(run.id)
            if run.state is None or not run.state.is_final():
                continue
            cell = waiting.pop(run.id)
            if not run.state.is_completed():
                errors[cell.key or ""] = f"{run.state.name}: {run.state.message or 'without a word'}"
            get_run_logger().info("%s: %s, %d to go", cell.name, run.state.name, len(waiting))
        errors |= {waiting.pop(run).key or "": "its run was deleted before it had ended: run the sweep again" for run in deleted}
        time.sleep(SECONDS)
    return errors


def _runs(client: SyncPrefectClient, ids: Sequence[UUID]) -> Iterable[FlowRun]:
    for start in range(0, len(ids), PAGE):
        some = FlowRunFilter(id=FlowRunFilterId(any_=list(ids[start : start + PAGE])))
        yield from client.read_flow_runs(flow_run_filter=some, limit=PAGE)


def _unfinished(client: SyncPrefectClient, wanted: FlowRunFilter) -> list[FlowRun]:
    found: list[FlowRun] = []
    while page := client.read_flow_runs(flow_run_filter=wanted, limit=PAGE, offset=len(found)):
        found += page
    return [run for run in found if run.state is None or not run.state.is_final()]


def _cancel(client: SyncPrefectClient, runs: Iterable[FlowRun]) -> None:
    for run in runs:
        client.set_flow_run_state(run.id, Cancelling())

"""A sweep over the processes of a Dask cluster: Prefect's Dask task runner, each object a task."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prefect import flow, task
from prefect.logging import get_run_logger
from prefect.states import State

from flows.order import OrderError, take_order
from flows.sweep_plan import Cell
from flows.sweep_run import make_plainly, place_of, sentence
from tasks.retries import DELAYS, is_passing
from tasks.step import Event


def over_dask(cells: Sequence[Cell], *, workers: int, scheduler: str | None) -> dict[str, str]:
    """Have every object dreamed on the cluster; by key, the sentences of those that failed.

    Args:
      workers: processes on this machine, one object at a time each; without a scheduler.
      scheduler: tcp://host:port of a cluster whose workers see the same store.

    Raises: OrderError: Dask is not installed.
    """
    try:
        from prefect_dask import DaskTaskRunner
    except ImportError:
        raise OrderError('expected prefect-dask, which is not installed: run `pip install "dreamfields[distributed]"`') from None
    here = {"n_workers": workers, "threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    runner: Any = DaskTaskRunner(address=scheduler) if scheduler else DaskTaskRunner(cluster_kwargs=here)
    said = spread.with_options(task_runner=runner)([{**cell.parameters, "name": cell.run_name} for cell in cells])
    return {cell.key or "": text for cell, text in zip(cells, said) if text}


@flow(name="coco-sweep-objects", persist_result=False, validate_parameters=False)
def spread(objects: list[dict[str, Any]]) -> list[str | None]:
    """Every object as a task of the runner; the sentence of each that failed, None of the others."""
    running = [dream_object.with_options(task_run_name=wanted.pop("name")).submit(wanted) for wanted in objects]
    states = []
    for future in running:
        future.wait()
        states.append(future.state)
    return [None if state.is_completed() else _why(state) for state in states]


def _why(state: State) -> str:
    error = state.result(raise_on_failure=False)
    return sentence(error) if isinstance(error, BaseException) else state.message or state.name or ""


def _try_again(task: Any, run: Any, state: State) -> bool:
    return is_passing(state.data)


@task(name="object", persist_result=False, retries=len(DELAYS), retry_delay_seconds=list(DELAYS), retry_condition_fn=_try_again)
def dream_object(parameters: dict[str, Any]) -> str:
    """One object on a process of the cluster, through the same recipe; the digest of its configuration."""
    order = take_order(**{**parameters, **{name: parameters[name] or () for name in ("among", "judges")}, "out": Path(parameters["out"])})
    log = get_run_logger()

    def hear(event: Event) -> None:
        if event["event"] in ("note", "resumed", "rolled_back", "end"):
            log.info("%s: %s", event["event"], ", ".join(f"{name} {value}" for name, value in event.items() if name != "event"))

    return str(make_plainly(order, place_of(order, report=hear))["config_digest"])

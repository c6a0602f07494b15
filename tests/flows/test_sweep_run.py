"""Objects one after the other: failures are written down, a stop stops all, only what may pass is tried again."""

from __future__ import annotations

import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from uuid import UUID, uuid4

import pytest
from prefect.client.schemas.objects import FlowRun
from prefect.states import Completed

from dreamfields_core.captions import CaptionError
from flows import coco_sweep, sweep_pool
from flows.sweep_plan import Cell
from flows.sweep_run import persistently, run_cells
from storage.errors import StorageFull, StoreUnreachable
from tasks.child import ChildError
from tasks.encoders import EncoderError
from tasks.optimize import OptimizeError, OptimizeInterrupted, OptimizeStopped
from tasks.retries import is_passing

CELLS = [Cell("v", caption, 0, {}) for caption in ("one", "two", "three")]


def test_what_fails_is_written_down_and_the_rest_goes_on() -> None:
    made: list[str] = []
    failed: list[tuple[str, str]] = []

    def make(cell: Cell) -> None:
        if cell.caption == "two":
            raise OptimizeError("expected finite steps")
        made.append(cell.caption)

    run_cells(CELLS, make, lambda cell, text: failed.append((cell.caption, text)))
    assert made == ["one", "three"] and failed == [("two", "expected finite steps")]


def test_a_stop_stops_all() -> None:
    made: list[str] = []

    def make(cell: Cell) -> None:
        made.append(cell.caption)
        raise OptimizeStopped("told to stop")

    with pytest.raises(OptimizeStopped):
        run_cells(CELLS, make, lambda cell, text: None)
    assert made == ["one"]


def wrapped(cause: Exception) -> Exception:
    error = EncoderError("the model cannot be fetched")
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "passes"),
    [
        (StoreUnreachable("no answer"), True),
        (ChildError("was killed by SIGKILL"), True),
        (ConnectionResetError(), True),
        (wrapped(TimeoutError()), True),
        (wrapped(ValueError()), False),
        (CaptionError("empty"), False),
        (OptimizeError("not finite"), False),
        (OptimizeInterrupted("the store did not answer"), True),
        (OptimizeStopped("told to stop"), False),
        (StorageFull("no room"), False),
        (FileNotFoundError(), False),
        (None, False),
    ],
)
def test_infrastructure_passes_and_refusals_do_not(error: object, passes: bool) -> None:
    assert is_passing(error) is passes


@pytest.mark.parametrize(("failures", "calls", "ends"), [(0, 1, "done"), (2, 3, "done"), (3, 3, "no answer")])
def test_what_may_pass_is_tried_three_times(failures: int, calls: int, ends: str) -> None:
    seen: list[str] = []
    told: list[str] = []

    def work() -> str:
        seen.append("call")
        if len(seen) <= failures:
            raise StoreUnreachable("no answer")
        return "done"

    try:
        came: Any = persistently(work, told.append, delays=(0.0, 0.0))
    except StoreUnreachable as error:
        came = str(error)
    assert (came, len(seen), len(told)) == (ends, calls, min(failures, 2))


def test_a_refusal_is_not_tried_again(tmp_path: Path) -> None:
    seen: list[str] = []

    def work() -> None:
        seen.append("call")
        raise CaptionError("empty")

    with pytest.raises(CaptionError):
        persistently(work, seen.append, delays=(0.0,))
    assert seen == ["call"]


def test_braces_of_a_caption_are_no_parameters_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    names: list[str] = []

    def with_options(*, flow_run_name: str) -> Any:
        return lambda **parameters: names.append(flow_run_name.format(**parameters))  # as Prefect does it

    monkeypatch.setattr(coco_sweep, "dream", SimpleNamespace(with_options=with_options))
    cell = Cell("v", "a set {1, 2} of {caption}", 0, {"caption": "spoilt"})
    assert coco_sweep.one_by_one(SimpleNamespace(), [cell]) == {}  # type: ignore[arg-type]
    assert names == [cell.name]


def test_a_run_that_somebody_deletes_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = {uuid4(): cell for cell in CELLS[:2]}
    there, looks = dict.fromkeys(runs), 0

    def read_flow_runs(flow_run_filter: Any, limit: int) -> list[FlowRun]:
        nonlocal looks
        looks += 1
        assert looks < 5, "it would wait for ever"
        if looks == 2:
            there.pop(next(iter(runs)))
        wanted: list[UUID] = flow_run_filter.id.any_
        return [FlowRun(id=run, flow_id=uuid4(), state=Completed() if looks > 2 else None) for run in wanted if run in there]

    monkeypatch.setattr(sweep_pool, "SECONDS", 0.0)
    monkeypatch.setattr(sweep_pool, "get_run_logger", lambda: logging.getLogger("pool"))
    monkeypatch.setattr(Cell, "key", property(lambda cell: cell.caption))
    client: Any = SimpleNamespace(read_flow_runs=read_flow_runs)
    errors = sweep_pool._wait(client, dict(runs))
    assert list(errors) == ["one"] and "deleted" in errors["one"]

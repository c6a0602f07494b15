"""A child that is told to end, and does not."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from storage.artifacts import put_artifact
from storage.store import open_store
from tasks import child, optimize
from tasks.child import Child, ChildError
from tasks.optimize import OptimizeInterrupted, OptimizeStopped
from tasks.retries import is_passing
from tasks.step import Event, Place, StopRequest, Work
from tests.tasks.tiny import tiny

DEAF = """
import json, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print(json.dumps({"event": "started"}), flush=True)
time.sleep(120)
"""
UNLUCKY = """
from storage.errors import StoreUnreachable
from tasks import optimize_worker

def fail(*arguments):
    raise StoreUnreachable("the store did not answer")

optimize_worker._optimize = fail
raise SystemExit(optimize_worker.main())
"""


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose modules a child finds."""
    (tmp_path / "deaf.py").write_text(DEAF)
    (tmp_path / "unlucky.py").write_text(UNLUCKY)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(child, "PATIENCE", 0.5)
    return tmp_path


def work(place: Place) -> Work:
    return Work(place, tiny(), {"text_embedding": put_artifact(place.store, "text_embedding.npy", b"words", "text/plain")}, "key")


def test_a_child_that_does_not_end_is_killed_when_its_time_is_over(modules: Path) -> None:
    deaf = Child("deaf", {})
    assert next(deaf.events()) == {"event": "started"}
    begun = time.monotonic()
    assert deaf.stop() is None and deaf.told_to_end
    assert time.monotonic() - begun < 30
    deaf = Child("deaf", {})
    for _ in (events := deaf.events()):
        deaf.terminate()
        break
    with pytest.raises(ChildError, match="killed by SIGKILL: the same"):
        list(events)
    deaf.close()


def test_a_dream_that_is_told_to_stop_and_does_not_is_not_tried_again(modules: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(optimize, "WORKER", "deaf")
    stop = StopRequest()

    def hear(event: Event) -> None:
        stop.request()

    place = Place(open_store(modules / "store"), hear, stop=stop)
    with pytest.raises(OptimizeStopped, match="last checkpoint") as caught:
        optimize.optimize(work(place))
    assert not is_passing(caught.value)


def test_an_outage_in_the_long_step_is_worth_another_try(modules: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(optimize, "WORKER", "unlucky")
    with pytest.raises(OptimizeInterrupted, match=r"^the store did not answer$") as caught:
        optimize.optimize(work(Place(open_store(modules / "store"))))
    assert is_passing(caught.value)

"""Killed with -9 at any instant, parent or worker, and run again: the same bits, and nothing done twice that was saved."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from pathlib import Path

import pytest

from storage.checkpoints import latest_checkpoint
from storage.store import open_store
from tests.tasks.processes import Process, gone

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks at processes through /proc")
PARENT = "tests.tasks.parent"


def run_whole(store: Path, *settings: str) -> tuple[list[dict], float]:
    """Uninterrupted: what it made, and how long it took."""
    begun = time.monotonic()
    process = Process(PARENT, str(store), *settings)
    assert process.end() == 0, process.text()
    return process.events("record")[0]["outputs"], time.monotonic() - begun


def kill_often(store: Path, kills: int, life: float, *settings: str) -> list[dict]:
    """Kill parent or worker at random instants of a life, check what is left, go on; what was made in the end."""
    rng, saved = random.Random(kills), 0
    for number in range(kills):
        process = Process(PARENT, str(store), *settings)
        process.for_seconds(rng.uniform(0, life))
        worker = started[0]["pid"] if (started := process.events("started")) else None
        if worker and number % 2:
            os.kill(worker, signal.SIGKILL) if gone(worker, within=0) is False else None
            process.end()
        process.kill()
        assert worker is None or gone(worker, within=20), "a worker outlived its parent"
        process.end()
        saved = check(process, store, saved)
    process = Process(PARENT, str(store), *settings)
    assert process.end() == 0, process.text()
    check(process, store, saved)
    return process.events("record")[0]["outputs"]


def check(process: Process, store: Path, saved: int) -> int:
    """No step that was saved before is executed again; what is saved now."""
    executed = [event["step"] for event in process.events("step")]
    assert executed == list(range(saved + 1, saved + 1 + len(executed))), (saved, executed)
    runs = [key.split("/")[1] for key in open_store(store).list("runs")]
    newest = latest_checkpoint(open_store(store), runs[0]) if runs else None
    reported = max((event["step"] for event in process.events("saved")), default=0)
    assert (newest.step if newest else 0) >= max(reported, saved)
    return newest.step if newest else 0


def test_a_kill_of_parent_and_one_of_worker(tmp_path: Path) -> None:
    settings = ("optim.steps=60", "optim.checkpoint_every=7")
    whole, life = run_whole(tmp_path / "whole", *settings)
    assert kill_often(tmp_path / "killed", 2, life, *settings) == whole


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_twenty_kills(tmp_path: Path) -> None:
    settings = ("optim.steps=200", "optim.checkpoint_every=11")
    whole, life = run_whole(tmp_path / "whole", *settings)
    assert kill_often(tmp_path / "killed", 20, life, *settings) == whole


def test_two_processes_on_one_run_do_it_once(tmp_path: Path) -> None:
    both = [Process(PARENT, str(tmp_path / "store")) for _ in range(2)]
    assert [process.end() for process in both] == [0, 0], "".join(process.text() for process in both)
    first, second = (process.events("record")[0] for process in both)
    assert first["outputs"] == second["outputs"]
    assert sorted(len(process.events("step")) for process in both) == [0, 12]
    assert sum("Another process is working" in process.text() for process in both) == 1

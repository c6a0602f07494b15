"""Killed with -9 at any instant: what was reported as saved is there, and it is whole."""

from __future__ import annotations

import random
import subprocess
import time
from collections.abc import Callable

import numpy as np
import pytest

from storage.checkpoints import latest_checkpoint
from storage.contract import Store
from storage.store import open_store

WRITER = """
import sys
import numpy as np
from storage.checkpoints import CheckpointWriter
from storage.store import open_store
writer = CheckpointWriter(open_store(sys.argv[1]), "run")
print("ready", flush=True)
for step in range(int(sys.argv[2]) + 1, 10**6):
    writer.save(step, {f"leaf_{i}": np.full((64, 65), step * 8 + i, np.float32) for i in range(8)}, {"step": step})
    print(step, flush=True)
"""


def kill_often(store: Store, child: Callable[..., subprocess.Popen[str]], kills: int, longest: float) -> None:
    """Start a writer where the last one ended, kill it, look; `kills` times."""
    rng, step = random.Random(kills), 0
    for _ in range(kills):
        process = child(WRITER, store.url, str(step))
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(rng.uniform(0, longest))
        process.kill()
        reported = [int(line) for line in process.communicate()[0].split("\n")[:-1]]
        found = latest_checkpoint(store, "run")
        newest = found.step if found is not None else 0
        assert newest >= max(reported, default=step)
        step = newest
        if found is not None:
            assert found.metadata == {"step": step}
            assert all(np.all(found.arrays[f"leaf_{i}"] == step * 8 + i) for i in range(8))
    assert step > 0


@pytest.fixture(params=["local", "s3"])
def kept(request: pytest.FixtureRequest) -> Store:
    """A store that outlives its process."""
    return request.getfixturevalue("local") if request.param == "local" else open_store(f"{request.getfixturevalue('s3')}/killed")


def test_a_few_kills(kept: Store, child: Callable[..., subprocess.Popen[str]], caplog: pytest.LogCaptureFixture) -> None:
    kill_often(kept, child, 5, 0.3)
    assert caplog.text == ""  # a kill damages nothing, so nothing is passed over


@pytest.mark.slow
def test_a_hundred_kills(kept: Store, child: Callable[..., subprocess.Popen[str]], caplog: pytest.LogCaptureFixture) -> None:
    kill_often(kept, child, 100, 0.2)
    assert caplog.text == ""

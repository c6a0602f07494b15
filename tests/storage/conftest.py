"""One suite, every backend: a folder, memory, and S3 as a server on the loopback speaks it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from storage.contract import Store
from storage.store import open_store

REPO = Path(__file__).resolve().parents[2]


@pytest.fixture(params=["local", "memory", "s3"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    """A new, empty store."""
    if request.param == "s3":
        return open_store(f"{request.getfixturevalue('s3')}/store")
    return open_store(tmp_path / "store" if request.param == "local" else "memory://")


@pytest.fixture
def local(tmp_path: Path) -> Store:
    """A new, empty folder."""
    return open_store(tmp_path / "store")


def flip(store: Store, key: str, position: int, bit: int = 0) -> None:
    """Damage one bit, as a tired disk would."""
    data = bytearray(store.get(key))
    data[position] ^= 1 << bit
    store.delete(key)
    store.put(key, bytes(data))


@pytest.fixture(name="flip")
def flip_fixture() -> Callable[..., None]:
    """`flip(store, key, position, bit=0)`."""
    return flip


@pytest.fixture
def child() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """`child(source, *arguments)` runs Python source in a process of its own, with a pipe to read; what is left over is killed."""
    running: list[subprocess.Popen[str]] = []

    def start(source: str, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", source, *arguments],
            cwd=REPO,
            env={**os.environ, "PYTHONPATH": str(REPO)},
            stdout=subprocess.PIPE,
            text=True,
        )
        running.append(process)
        return process

    yield start
    for process in running:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()

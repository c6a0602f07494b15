"""The command as a user types it, on the smallest dream."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from storage.contract import Store
from storage.store import open_store
from tests.tasks.processes import Process
from tests.tasks.tiny import SETTINGS

CAPTION = "a red mushroom"
TINY = [argument for setting in SETTINGS for argument in ("--set", setting)]


class Dreams:
    """A folder in which `dreamfields dream` is called."""

    def __init__(self, out: Path) -> None:
        self.out = out

    def start(self, *more: str, caption: str = CAPTION) -> Process:
        """The command, running."""
        return Process("flows.cli", "dream", caption, "--out", str(self.out), *TINY, *more)

    def dream(self, *more: str, caption: str = CAPTION) -> tuple[str, dict[str, Any], Path]:
        """The command, done: what it printed, result.json, and the run's folder."""
        process = self.start(*more, caption=caption)
        assert process.end() == 0, process.text()
        line = next(line for line in process.lines if "result.json" in line)
        path = Path(line.split(maxsplit=3)[-1].strip())
        return process.text(), json.loads(path.read_text()), path.parent


@pytest.fixture(scope="session")
def dreamt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds one finished dream; not to be changed."""
    out = tmp_path_factory.mktemp("dreamt")
    Dreams(out).dream()
    return out


@pytest.fixture
def dreams(tmp_path: Path) -> Dreams:
    """An empty folder."""
    return Dreams(tmp_path / "dreams")


@pytest.fixture
def again(dreamt: Path, tmp_path: Path) -> Dreams:
    """A copy of the finished dream's store, to be changed at will."""
    shutil.copytree(dreamt, tmp_path / "again")
    return Dreams(tmp_path / "again")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty one, in a folder."""
    return open_store(tmp_path / "store")


@pytest.fixture
def to(tmp_path: Path) -> Path:
    """The folder that a pull brings assets to; not there yet."""
    return tmp_path / "assets"

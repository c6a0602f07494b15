"""A folder of pulled assets, and what a test asks of it."""

from __future__ import annotations

import json
from pathlib import Path

from flows.pull import Pulled
from flows.pull_folder import MANIFEST
from flows.pull_object import ABOUT
from storage.contract import Entry, Store
from storage.digests import sha256_file


class Counting(Store):
    """A store that counts what is read."""

    def __init__(self, store: Store) -> None:
        self._store, self.url, self.read = store, store.url, list[str]()

    def get(self, key: str) -> bytes:
        self.read.append(key)
        return self._store.get(key)

    def put(self, key: str, data: bytes) -> None:
        raise AssertionError("a pull writes nothing to the store")

    create = put

    def delete(self, key: str) -> None:
        raise AssertionError("a pull deletes nothing from the store")

    def head(self, key: str) -> int | None:
        return self._store.head(key)

    def entries(self, prefix: str = "") -> list[Entry]:
        return self._store.entries(prefix)


def objects(to: Path) -> dict[str, dict]:  # type: ignore[type-arg]
    return dict(json.loads((to / MANIFEST).read_text())["objects"])


def files(to: Path) -> dict[str, tuple[str, int]]:
    """Every visible file: its digest, and when it was written."""
    visible = [path for path in to.rglob("*") if path.is_file() and not any(part.startswith(".") for part in path.relative_to(to).parts)]
    return {path.relative_to(to).as_posix(): (sha256_file(path), path.stat().st_mtime_ns) for path in visible}


def counts(result: Pulled) -> tuple[int, ...]:
    return tuple(map(len, (result.added, result.changed, result.removed, result.same, result.refused)))


def assert_whole(to: Path) -> None:
    """Every object's folder is what its manifest says, and nothing is half there."""
    for name, about in objects(to).items():
        assert set(about["files"]) | {ABOUT} == {path.name for path in (to / name).iterdir()}
        assert all(sha256_file(to / name / file) == said["sha256"] for file, said in about["files"].items())
    assert not list(to.glob(".staging/*"))

"""A folder: nothing half-written is visible, a full or forbidden disk is one clear sentence."""

from __future__ import annotations

import errno
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from storage.contract import Store
from storage.errors import AlreadyExists, StorageFull, StoreNotWritable, StoreUnreachable
from storage.local import STAGING, write_file
from storage.store import open_store


def fail(code: int) -> Callable[..., None]:
    """A stand-in for a system call that fails."""

    def call(*arguments: object, **named: object) -> None:
        raise OSError(code, os.strerror(code))

    return call


FULL = """
import resource, sys
from storage.errors import StorageFull
from storage.store import open_store
store = open_store(sys.argv[1])
store.put("a", b"old")
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    store.put("a", bytes(1_000_000))
except StorageFull as problem:
    print(problem, store.get("a"), store.list())
"""


def test_the_kernel_stops_a_write_halfway(local: Store, child: Callable[..., subprocess.Popen[str]]) -> None:
    said = child(FULL, local.url).communicate()[0]
    assert "Expected room for 1000000 bytes" in said and "b'old' ['a']" in said
    assert [path.name for path in (Path(local.url) / STAGING).iterdir()] == []


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("call", ["fsync", "replace", "link"])
def test_a_full_disk_loses_nothing(local: Store, monkeypatch: pytest.MonkeyPatch, call: str, code: int) -> None:
    local.put("a", b"old")
    monkeypatch.setattr(os, call, fail(code))
    write, key = (local.create, "b") if call == "link" else (local.put, "a")
    with pytest.raises(StorageFull, match=r"Expected room for 3 bytes .* disk is full .* free some space"):
        write(key, b"new")
    monkeypatch.undo()
    assert local.get("a") == b"old"
    assert local.list() == ["a"]
    assert [path.name for path in (Path(local.url) / STAGING).iterdir()] == []


def test_other_disk_errors_have_a_sentence_too(local: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", fail(errno.EIO))
    with pytest.raises(StoreUnreachable, match="check the disk"):
        local.put("a", b"new")


def test_a_file_where_the_folder_should_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreNotWritable, match="choose a folder"):
        open_store(tmp_path / "file").check_writable()
    with pytest.raises(StoreNotWritable, match="choose a folder"):
        open_store(tmp_path / "file" / "below").check_writable()


@pytest.mark.parametrize("code", [errno.EACCES, errno.EROFS])
def test_a_folder_that_may_not_be_written(local: Store, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    monkeypatch.setattr(os, "open", fail(code))
    with pytest.raises(StoreNotWritable, match="choose a folder that you may write"):
        local.check_writable()


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_read_only_folder(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(StoreNotWritable):
        open_store(tmp_path / "store").check_writable()


def test_create_without_hard_links(local: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "link", fail(errno.EPERM))
    local.create("a", b"mine")
    local.create("a", b"mine")
    with pytest.raises(AlreadyExists):
        local.create("a", b"yours")
    assert local.get("a") == b"mine"


def test_what_killed_writers_left_is_hidden_then_swept(local: Store) -> None:
    local.put("a", b"")
    staging = Path(local.url) / STAGING
    for name, age in (("old", 7200), ("young", 60)):
        (staging / name).write_bytes(b"half")
        os.utime(staging / name, (time.time() - age,) * 2)
    again = open_store(local.url)
    assert again.list() == ["a"]
    again.put("b", b"")
    assert [path.name for path in staging.iterdir()] == ["young"]


def test_bytes_are_synced_before_they_are_named(local: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    for name in ("fsync", "replace"):
        real = getattr(os, name)

        def noted(*arguments: object, real: Callable[..., None] = real, name: str = name) -> None:
            order.append(name)
            real(*arguments)

        monkeypatch.setattr(os, name, noted)
    local.put("a", b"x")
    local.put("a", b"y")
    assert order[-3:] == ["fsync", "replace", "fsync"]


def test_write_file_is_whole_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_file(tmp_path / "new/a.glb", b"one")
    monkeypatch.setattr(os, "replace", fail(errno.ENOSPC))
    with pytest.raises(StorageFull):
        write_file(tmp_path / "new/a.glb", b"two")
    assert [(path.name, path.read_bytes()) for path in (tmp_path / "new").iterdir()] == [("a.glb", b"one")]

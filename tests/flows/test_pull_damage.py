"""Pulling what is damaged, cut short or has no room: whole or not at all, and named."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import pytest

from flows.pull import pull
from flows.pull_object import ABOUT
from storage.contract import Store
from storage.digests import sha256_file
from storage.errors import StoreNotWritable
from tests.flows.pulled import Counting, assert_whole, counts, files, objects
from tests.flows.records import glb, keep_dream
from tests.tasks.processes import Process


def test_a_tampered_artifact_is_refused_and_named_and_the_others_come(store: Store, to: Path) -> None:
    good, bad = keep_dream(store, "a good one"), keep_dream(store, "a bad one")
    ref = bad.output("mesh.glb")
    path = store.local_path(ref.key)
    assert path is not None
    path.write_bytes(b"X" + path.read_bytes()[1:])
    result = pull(store, to)
    (name,) = result.refused
    assert name.startswith("a-bad-one-") and "mesh.glb with digest" in result.refused[name]
    assert not (to / name).exists() and name not in objects(to)
    assert [about["record"] for about in objects(to).values()] == [good.key]


def test_a_tampered_artifact_leaves_the_older_good_one(store: Store, to: Path) -> None:
    keep_dream(store)
    (name,) = pull(store, to).added
    before = files(to)
    newer = keep_dream(store, mesh=b"a newer mesh")
    store.delete(newer.output("mesh.glb").key)
    assert list(pull(store, to).refused) == [name] and files(to) == before


def test_a_damaged_record_is_named(store: Store, to: Path) -> None:
    record = keep_dream(store)
    path = store.local_path(f"artifacts/dream/{record.key}.json")
    assert path is not None
    path.write_bytes(path.read_bytes().replace(b'"seed": 0', b'"seed": 1'))
    result = pull(store, to)
    assert list(result.refused) == [f"artifacts/dream/{record.key}.json"] and "checksum" in next(iter(result.refused.values()))


def test_a_record_that_cannot_be_read_is_not_taken_for_removed(store: Store, to: Path) -> None:
    record = keep_dream(store)
    (name,) = pull(store, to).added
    before = files(to)
    path = store.local_path(f"artifacts/dream/{record.key}.json")
    assert path is not None
    path.write_bytes(path.read_bytes().replace(b'"seed": 0', b'"seed": 1'))
    for prune in (False, True):
        result = pull(store, to, prune=prune)
        assert counts(result) == (0, 0, 0, 0, 1) and name in objects(to) and files(to) == before


def test_a_mesh_that_cannot_be_read_is_refused_and_the_others_come(store: Store, to: Path) -> None:
    good, bad = keep_dream(store, "a good one", mesh=glb()), keep_dream(store, "a bad one", mesh=b"no mesh")
    result = pull(store, to, formats=["stl"])
    (name,) = result.refused
    assert name.endswith(bad.key[:12]) and "a mesh to make stl of" in result.refused[name] and "\n" not in result.refused[name]
    assert [about["record"] for about in objects(to).values()] == [good.key]


def test_a_file_where_the_folder_should_be_is_one_sentence(store: Store, to: Path) -> None:
    keep_dream(store)
    to.write_text("a file")
    for folder in (to, to / "assets"):
        with pytest.raises(StoreNotWritable, match="choose a folder"):
            pull(store, folder)


@pytest.mark.parametrize("damage", ["flip", "delete", "about"])
def test_what_was_damaged_in_the_folder_is_brought_again(store: Store, to: Path, damage: str) -> None:
    keep_dream(store)
    (name,) = pull(store, to).added
    mesh = to / name / "mesh.glb"
    good = mesh.read_bytes()
    if damage == "delete":
        mesh.unlink()
    elif damage == "flip":
        mesh.write_bytes(b"x" * len(good))
    else:
        (to / name / ABOUT).write_text("{")
    assert pull(store, to).changed == [name] and mesh.read_bytes() == good
    assert_whole(to)


@pytest.mark.slow
def test_a_killed_pull_leaves_no_half_file_and_the_next_one_goes_on(store: Store, to: Path) -> None:
    for seed in range(150):
        keep_dream(store, seed=seed, mesh=bytes([seed]) * 20_000)
    process = Process("flows.cli", "pull", "--store", store.url, "--to", str(to))
    deadline = time.monotonic() + 120
    while not list(to.glob("a-red-mushroom-*")) and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.05)
    process.process.send_signal(signal.SIGKILL)
    process.process.wait()
    there = [path for path in to.iterdir() if not path.name.startswith(".") and path.is_dir()]
    assert len(there) > 0
    for folder in there:
        about = json.loads((folder / ABOUT).read_text())
        assert {name: sha256_file(folder / name) for name in about["files"]} == {n: f["sha256"] for n, f in about["files"].items()}
    counting = Counting(store)
    pull(counting, to)
    fetched = [key for key in counting.read if key.startswith("blobs/")]
    assert len(objects(to)) == 150 and len(fetched) <= 150 - len(there)
    assert_whole(to)


def test_a_full_disk_is_an_error_and_leaves_what_was_there(store: Store, to: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from storage import local
    from storage.errors import StorageFull

    keep_dream(store)
    pull(store, to)
    before = files(to)
    keep_dream(store, mesh=b"m" * 1000)

    def full(path: Path, data: bytes) -> None:
        import errno

        if len(data) == 1000:
            raise OSError(errno.ENOSPC, "No space left on device")
        original(path, data)

    original = local.write_synced
    monkeypatch.setattr(local, "write_synced", full)
    with pytest.raises(StorageFull, match="the disk is full"):
        pull(store, to)
    assert files(to) == before and not list(to.glob(".staging/*"))

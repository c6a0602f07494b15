"""Checkpoints: committed or not there, fenced, pruned, and passed over when damaged."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ml_dtypes
import numpy as np
import pytest
import zarr

from storage.checkpoints import CheckpointWriter, latest_checkpoint, manifest_keys
from storage.contract import Store
from storage.errors import AlreadyExists, FencedError, NotJson, StepWentBack, StorageFull, StoreUnreachable
from storage.store import open_store


def state(step: int) -> dict[str, Any]:
    """A small training state that is a function of its step."""
    return {
        "params/kernel": np.full((4, 8), step, np.float32),
        "params/half": np.full(3, step % 128, ml_dtypes.bfloat16),
        "count": np.int32(step),
        "metrics/loss": np.arange(step, dtype=np.float64),
    }


def restored(store: Store, run: str = "chair") -> int | None:
    """The latest step, after a look at every array."""
    found = latest_checkpoint(store, run)
    if found is None:
        return None
    for name, value in state(found.step).items():
        assert found.arrays[name].dtype == value.dtype and np.array_equal(found.arrays[name], value), name
    assert found.metadata == {"at": found.step}
    return found.step


def save(writer: CheckpointWriter, *steps: int) -> None:
    """Save the states of these steps."""
    for step in steps:
        writer.save(step, state(step), {"at": step})


def test_the_newest_is_found(store: Store) -> None:
    assert latest_checkpoint(store, "chair") is None
    save(CheckpointWriter(store, "chair"), 5, 10, 100)
    assert restored(store) == 100
    assert latest_checkpoint(store, "chai") is None


def test_zarr_opens_a_checkpoint_on_disk(local: Store) -> None:
    manifest = CheckpointWriter(local, "chair").save(3, state(3))
    with zarr.storage.ZipStore(Path(local.url) / manifest.object, mode="r") as opened:
        leaf = zarr.open_group(opened, mode="r")["params/kernel"]
        assert isinstance(leaf, zarr.Array) and np.all(np.asarray(leaf[...]) == 3)


def test_the_same_state_is_the_same_object(store: Store) -> None:
    digests = {CheckpointWriter(store, run).save(7, state(7), {"at": 7}).sha256 for run in ("a", "b")}
    assert len(digests) == 1


def test_the_newest_few_are_kept(store: Store) -> None:
    writer = CheckpointWriter(store, "chair", keep=2)
    save(writer, 1, 2, 3, 4)
    assert len(store.list("runs/chair/ckpt")) == len(store.list("runs/chair/manifest")) == 2
    save(CheckpointWriter(store, "chair", keep=1), 5)
    assert len(store.list("runs/chair/ckpt")) == len(store.list("runs/chair/manifest")) == 1
    assert restored(store) == 5


def test_a_saved_step_is_not_saved_again(store: Store) -> None:
    writer = CheckpointWriter(store, "chair")
    assert writer.save(4, state(4)) == writer.save(4, state(4))
    with pytest.raises(StepWentBack, match="open a new writer"):
        writer.save(3, state(3))


def test_going_back_takes_a_new_writer(store: Store) -> None:
    save(CheckpointWriter(store, "chair"), 10, 20)
    save(CheckpointWriter(store, "chair"), 15)
    assert restored(store) == 15


@pytest.mark.parametrize("where", np.linspace(0, 0.999, 12))
def test_a_flipped_byte_in_the_newest_object(
    store: Store, flip: Callable[..., None], caplog: pytest.LogCaptureFixture, where: float
) -> None:
    save(CheckpointWriter(store, "chair"), 1, 2)
    newest = store.list("runs/chair/ckpt")[-1]
    flip(store, newest, int(where * (store.head(newest) or 0)), bit=int(where * 8))
    assert restored(store) == 1
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "passed over for the next older one" in caplog.text and "Checkpoint 000001-000000002" in caplog.text


@pytest.mark.parametrize("where", np.linspace(0, 0.999, 6))
def test_a_flipped_byte_in_the_newest_manifest(store: Store, flip: Callable[..., None], where: float) -> None:
    save(CheckpointWriter(store, "chair"), 1, 2)
    newest = manifest_keys(store, "chair")[0]
    flip(store, newest, int(where * (store.head(newest) or 0)))
    assert restored(store) == 1


def test_a_lost_or_short_object(store: Store, caplog: pytest.LogCaptureFixture) -> None:
    save(CheckpointWriter(store, "chair"), 1, 2)
    older, newer = store.list("runs/chair/ckpt")
    store.put(newer, store.get(newer)[:-1])
    assert restored(store) == 1
    store.delete(newer)
    assert restored(store) == 1
    store.delete(older)
    assert restored(store) is None
    assert len(caplog.records) == 4


def test_a_damaged_checkpoint_takes_no_good_ones_place(store: Store, flip: Callable[..., None]) -> None:
    save(CheckpointWriter(store, "chair"), 1, 2)
    flip(store, store.list("runs/chair/ckpt")[-1], 100)
    save(CheckpointWriter(store, "chair"), 3)
    flip(store, store.list("runs/chair/ckpt")[-1], 100)
    assert restored(store) == 1


def test_a_newer_writer_fences_the_older(store: Store) -> None:
    first = CheckpointWriter(store, "chair")
    save(first, 1)
    second = CheckpointWriter(store, "chair")
    assert (first.epoch, second.epoch) == (1, 2)
    with pytest.raises(FencedError, match="another process opened it"):
        save(first, 2)
    save(second, 3)
    assert restored(store) == 3
    CheckpointWriter(store, "table").save(1, state(1))


def test_fenced_between_object_and_manifest(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    first = CheckpointWriter(store, "chair")
    save(first, 1)
    real = store.put
    monkeypatch.setattr(store, "put", lambda key, data: (real(key, data), CheckpointWriter(store, "chair"))[0])
    with pytest.raises(FencedError):
        save(first, 2)
    assert restored(store) == 1
    assert len(store.list("runs/chair/ckpt")) == 1


@pytest.mark.parametrize("write", ["put", "create"])
def test_a_full_disk_while_saving(store: Store, monkeypatch: pytest.MonkeyPatch, write: str) -> None:
    writer = CheckpointWriter(store, "chair")
    save(writer, 1)

    def full(key: str, data: bytes) -> None:
        raise StorageFull("Expected room, but the disk is full: free some space.")

    monkeypatch.setattr(store, write, full)
    with pytest.raises(StorageFull):
        save(writer, 2)
    monkeypatch.undo()
    assert restored(store) == 1
    assert len(store.list("runs/chair/ckpt")) == 1  # nothing is left over to fill the disk further
    save(writer, 2)
    assert restored(store) == 2


def test_a_commit_whose_answer_was_lost_is_retried(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = CheckpointWriter(store, "chair")
    real = store.create

    def lossy(key: str, data: bytes) -> None:
        real(key, data)
        raise StoreUnreachable("Expected an answer, got none.")

    monkeypatch.setattr(store, "create", lossy)
    with pytest.raises(StoreUnreachable):
        save(writer, 1)
    monkeypatch.undo()
    save(writer, 1)
    assert restored(store) == 1


def test_trouble_with_old_ones_does_not_fail_a_save(
    store: Store, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    writer = CheckpointWriter(store, "chair", keep=1)

    def refuse(key: str) -> None:
        raise StoreUnreachable("Expected an answer, got none.")

    monkeypatch.setattr(store, "delete", refuse)
    save(writer, 1, 2)
    assert restored(store) == 2
    assert "older ones could not be removed" in caplog.text


def test_orphans_are_swept_by_age(local: Store) -> None:
    save(CheckpointWriter(local, "chair"), 1)
    for name, age in (("000000002-000001-aa.zarr.zip", 7200), ("000000003-000001-bb.zarr.zip", 60)):
        local.put(f"runs/chair/ckpt/{name}", b"never committed")
        os.utime(Path(local.url) / "runs/chair/ckpt" / name, (time.time() - age,) * 2)
    os.utime(Path(local.url) / local.list("runs/chair/ckpt")[0], (0, 0))
    CheckpointWriter(local, "chair")
    assert [key.rsplit("/", 1)[1][:9] for key in local.list("runs/chair/ckpt")] == ["000000001", "000000003"]
    assert restored(local) == 1


def test_two_who_want_the_same_epoch(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "list", lambda prefix="": [])
    assert [CheckpointWriter(store, "chair").epoch for _ in range(3)] == [1, 2, 3]


def test_bad_arguments(store: Store) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        CheckpointWriter(store, "chair", keep=0)
    writer = CheckpointWriter(store, "chair")
    for step in (-1, 10**9, 1.5, True):
        with pytest.raises(ValueError, match="Expected a step"):
            writer.save(step, state(1))  # type: ignore[arg-type]
    with pytest.raises(NotJson):
        writer.save(1, state(1), {"loss": float("nan")})
    assert not store.list("runs/chair/ckpt")


def test_a_step_committed_by_a_stranger_is_not_replaced(store: Store) -> None:
    writer = CheckpointWriter(store, "chair")
    store.put("runs/chair/manifest/000001-000000001.json", b"a stranger's")
    with pytest.raises(AlreadyExists):
        save(writer, 1)


def test_nothing_is_said_when_all_is_well(store: Store, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "storage")
    save(CheckpointWriter(store, "chair"), 1, 2, 3)
    restored(store)
    assert caplog.text == ""


def test_a_run_reopened_by_address(s3: str) -> None:
    save(CheckpointWriter(open_store(f"{s3}/again"), "chair"), 1)
    assert restored(open_store(f"{s3}/again")) == 1

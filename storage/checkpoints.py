"""Checkpoints that are there or not, never half: an immutable zip, then a small manifest that commits it.

    runs/<run>/writer/<epoch>.json              claimed at open, create-only, never deleted
    runs/<run>/ckpt/<step>-<epoch>-<sha16>.zarr.zip
    runs/<run>/manifest/<epoch>-<step>.json     put last, create-only, with its own checksum

There is no mutable "latest": the newest is the highest (epoch, step). Opening a writer claims the next epoch and so
fences every writer before it. A damaged checkpoint is passed over for the next older one. To go back to an earlier step
(a rollback), open a new writer: its epoch outranks everything that the old one saved.
"""

import logging
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from storage.contract import Store, check_key
from storage.digests import sha256_bytes
from storage.errors import (
    AlreadyExists,
    DamagedCheckpoint,
    DamagedRecord,
    FencedError,
    MissingObject,
    StepWentBack,
    StorageError,
    StorageFull,
)
from storage.sealed import seal, unseal
from storage.zarr_zip import pack, unpack

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Manifest:
    """The commit of one checkpoint."""

    run: str
    epoch: int
    step: int
    object: str  # the zip's key
    size: int  # bytes
    sha256: str


@dataclass(frozen=True)
class Checkpoint:
    """A restored checkpoint: `arrays` by name, in the dtypes and shapes that were saved."""

    manifest: Manifest
    arrays: dict[str, np.ndarray]
    metadata: dict[str, Any]

    @property
    def step(self) -> int:
        """The step that was saved."""
        return self.manifest.step


class CheckpointWriter:
    """Writes the checkpoints of one run. The newest `keep` good ones stay; objects without a manifest go after `orphan_age` s."""

    def __init__(self, store: Store, run: str, *, keep: int = 2, orphan_age: float = 3600.0) -> None:
        """Claim the next epoch of `run`. Raises: BadKey, StorageFull, StoreNotWritable, StoreUnreachable."""
        if keep < 1:
            raise ValueError(f"Expected to keep at least 1 checkpoint, got keep={keep}: 2 leaves one to fall back on.")
        self.store, self.run, self.keep = store, run, keep
        self._last: Manifest | None = None
        self._good: dict[str, bool] = {}  # manifest key -> whether its checkpoint was found intact
        self.epoch = self._claim()
        self._sweep(orphan_age)

    def save(self, step: int, arrays: Mapping[str, Any], metadata: Mapping[str, Any] | None = None) -> Manifest:
        """Save and commit. A step that this writer saved last is not saved again: a step determines its state.

        Raises: FencedError, StepWentBack, BadLeaf, NotJson, StorageFull, StoreNotWritable, StoreUnreachable.
        """
        self._stop_if_fenced()
        if self._last is not None and step <= self._last.step:
            if step == self._last.step:
                return self._last
            raise StepWentBack(f"Expected a step after {self._last.step}, got {step}: open a new writer to go back.")
        data = pack(arrays, metadata)
        manifest = self._manifest(step, data)
        self.store.put(manifest.object, data)
        key = f"runs/{self.run}/manifest/{self.epoch:06d}-{step:09d}.json"
        try:
            self._stop_if_fenced()
            self.store.create(key, seal(asdict(manifest)))
        except (FencedError, StorageFull):  # surely not committed; after any other error it may be, so the object stays
            self.store.delete(manifest.object)
            raise
        self._last, self._good[key] = manifest, True
        self._prune()
        return manifest

    def _manifest(self, step: int, data: bytes) -> Manifest:
        if type(step) is not int or not 0 <= step < 10**9:
            raise ValueError(f"Expected a step from 0 to 999999999, got {step!r}: count steps in Python integers.")
        digest = sha256_bytes(data)
        name = f"runs/{self.run}/ckpt/{step:09d}-{self.epoch:06d}-{digest[:16]}.zarr.zip"
        return Manifest(self.run, self.epoch, step, name, len(data), digest)

    def _claim(self) -> int:
        """The first epoch that nobody has; two who want the same one are told apart by their token."""
        token = seal({"token": os.urandom(16).hex(), "pid": os.getpid(), "created": round(time.time(), 3)})
        taken = [int(key.rsplit("/", 1)[1].split(".")[0]) for key in self.store.list(f"runs/{check_key(self.run)}/writer")]
        epoch = max(taken, default=0)
        while True:
            epoch += 1
            try:
                self.store.create(self._claim_key(epoch), token)
                return epoch
            except AlreadyExists:
                continue

    def _claim_key(self, epoch: int) -> str:
        return f"runs/{self.run}/writer/{epoch:06d}.json"

    def _stop_if_fenced(self) -> None:
        """Epochs follow one another and are never deleted, so the next number alone tells."""
        if self.store.head(self._claim_key(self.epoch + 1)) is not None:
            raise FencedError(
                f"Expected to be the only writer of run {self.run}, but another process opened it after this one: "
                "let that one finish, or stop it and start this one again."
            )

    def _prune(self) -> None:
        """Manifest first, then object: a kill in between leaves an orphan, which is swept. A failure costs space, not the save."""
        try:
            keys = manifest_keys(self.store, self.run)
            good = [key for key in keys if self._is_good(key)] if len(keys) > self.keep else keys
            for key in set(keys) - set(good[: self.keep]):
                name = _object_of(self.store, key)
                self.store.delete(key)
                if name is not None:
                    self.store.delete(name)
        except StorageError as problem:
            log.warning("The checkpoint is saved, but older ones could not be removed: %s", problem)

    def _is_good(self, key: str) -> bool:
        """Whether a checkpoint is worth a place among those kept; an earlier writer's is read once to know."""
        if key not in self._good:
            try:
                _read_object(self.store, key)
                self._good[key] = True
            except (DamagedRecord, DamagedCheckpoint, MissingObject):
                self._good[key] = False
        return self._good[key]

    def _sweep(self, age: float) -> None:
        """Remove objects that no manifest names: what a killed or fenced writer left."""
        oldest = time.time() - age
        objects = [entry.key for entry in self.store.entries(f"runs/{self.run}/ckpt") if entry.modified < oldest]
        named = {_object_of(self.store, key) for key in manifest_keys(self.store, self.run)} if objects else set()
        for key in objects:
            if key not in named:
                self.store.delete(key)


def latest_checkpoint(store: Store, run: str) -> Checkpoint | None:
    """The newest good checkpoint of `run`; None when there is none. Each damaged one that is passed over is warned of."""
    for key in manifest_keys(store, run):
        try:
            manifest, data = _read_object(store, key)
            return Checkpoint(manifest, *unpack(data))
        except (DamagedRecord, DamagedCheckpoint, MissingObject) as problem:
            if store.head(key) is not None:  # else the writer has just replaced it by a newer one
                log.warning("Checkpoint %s is passed over for the next older one: %s", key.rsplit("/", 1)[1][:-5], problem)
    return None


def manifest_keys(store: Store, run: str) -> list[str]:
    """The committed checkpoints of `run`, newest (epoch, step) first: the names are padded, so they sort as numbers."""
    return sorted(store.list(f"runs/{check_key(run)}/manifest"), reverse=True)


def _read_object(store: Store, key: str) -> tuple[Manifest, bytes]:
    """A manifest and its zip, proven. Raises: DamagedRecord, DamagedCheckpoint, MissingObject."""
    manifest = _read_manifest(store, key)
    data = store.get(manifest.object)
    if len(data) != manifest.size or sha256_bytes(data) != manifest.sha256:
        raise DamagedCheckpoint(f"Expected digest {manifest.sha256[:12]} at {store.locate(manifest.object)}, got other bytes: delete it.")
    return manifest, data


def _read_manifest(store: Store, key: str) -> Manifest:
    payload = unseal(store.get(key))
    try:
        return Manifest(**payload)
    except TypeError as problem:
        raise DamagedRecord(f"Expected the fields of a manifest at {store.locate(key)}, got others ({problem}): delete it.") from problem


def _object_of(store: Store, key: str) -> str | None:
    """The object that a manifest names; None when the manifest cannot say."""
    try:
        return _read_manifest(store, key).object
    except (DamagedRecord, MissingObject):
        return None

"""Dreams out of a store into a folder: verified by digest, only what changed, with a manifest that a program can read.

    from flows.pull import Only, pull
    changes = pull("s3://studio/dreams", "assets", formats=["glb", "usdz"], only=Only(min_score=0.3))

A pull may be killed at any moment: no half file is ever visible, and the next pull goes on with what is missing.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from flows.exports import check_formats
from flows.order import OrderError, sweep_key
from flows.pull_folder import MANIFEST, gone, read_manifest, remove, said, write_manifest
from flows.pull_object import ABOUT, Wanted, about_bytes, bring, read_about, same_facts, wanted
from storage.contract import Store
from storage.errors import BadReference, DamagedArtifact, DamagedRecord, MissingArtifact
from storage.local import explained, make_folder, write_file
from storage.locks import flock
from storage.mirror import mirrored
from storage.sealed import unseal
from storage.steps import StepRecord, find_record
from storage.store import open_store

RECORDS, STAGING, LOCK = ".records", ".staging", ".lock"
AT_ONCE = 8
"""Objects fetched side by side."""
Told = Callable[[str, str], None]
"""(what happened, name of the object)."""


@dataclass(frozen=True)
class Only:
    """Which dreams: all of what is said must hold.

    caption: text within the caption, case aside. min_score: least cosine by the dream's own judge, from the field.
    since: made then or later; UTC, unless it says otherwise. sweep: name of a sweep that the dream belongs to.
    """

    caption: str | None = None
    seed: int | None = None
    min_score: float | None = None
    since: datetime | None = None
    sweep: str | None = None


@dataclass
class Pulled:
    """Names of objects by what became of them. removed: the store no longer has them. refused: name -> the sentence that says why.
    moved: bytes fetched from the store, records aside."""

    manifest: Path
    added: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    same: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    moved: int = 0


def pull(
    store: str | Store,
    to: str | os.PathLike[str],
    *,
    formats: Sequence[str] = ("glb",),
    also: Sequence[str] = (),
    only: Only | None = None,
    prune: bool = False,
    told: Told = lambda what, name: None,
) -> Pulled:
    """Bring the folder `to` up to date with the dreams of a store, each in a folder of its own, and write its manifest.

    formats: glb (with lighter levels of detail, where the dream has some), obj, ply, stl, usdz. also: further files of a dream by
    name, turntable.mp4 for instance. prune: delete the folders of objects that the store no longer has, also those that an earlier
    pull let stand. What an earlier pull brought and this one does not ask for stays as it is.

    Raises:
      OrderError: an unknown format or sweep, a store without dreams.
      StorageError: the store or the folder does not answer; damage to one object is in `refused` instead.
    """
    source = open_store(store) if isinstance(store, str) else store
    check_formats(formats)
    folder = Path(to)
    with ExitStack() as held:
        with explained(folder, 0):
            make_folder(folder.absolute())
            held.enter_context(flock(folder / LOCK))
        shutil.rmtree(folder / STAGING, ignore_errors=True)  # of a pull that was killed
        before, result = read_manifest(folder), Pulled(folder / MANIFEST)
        records, damaged = _records(source, folder)
        if not records and not damaged:
            # Not "everything was removed": more likely a disk that is not mounted, or a slip of the pen.
            raise OrderError(f"expected a store with dreams in it, got {source.url}, which has none: check its address")
        result.refused |= damaged
        chosen = select(records, source, only or Only())
        objects = dict(before)
        try:
            for name, about in gone((said(folder) if prune else {}) | before, source, records, damaged):
                objects.pop(name, None)
                if prune:
                    remove(folder / name, about)
                result.removed.append(name)
                told("removed", name)
            _bring_all(chosen, source, folder, objects, result, formats, also, told)
        finally:
            write_manifest(folder, objects)
            shutil.rmtree(folder / STAGING, ignore_errors=True)
    return result


def select(records: dict[str, StepRecord], store: Store, only: Only) -> list[StepRecord]:
    """The records that are asked for, by key. Raises: OrderError."""
    keys = _of_sweep(store, only.sweep) if only.sweep is not None else records.keys()
    return [record for key, record in sorted(records.items()) if key in keys and _fits(record, only)]


def _fits(record: StepRecord, only: Only) -> bool:
    if only.caption is not None and only.caption.casefold() not in str(record.inputs["caption"]).casefold():
        return False
    if only.seed is not None and record.values["seed"] != only.seed:
        return False
    if only.since is not None and _utc(datetime.fromisoformat(record.created)) < _utc(only.since):
        return False
    return only.min_score is None or _cosine(record) >= only.min_score


def _cosine(record: StepRecord) -> float:
    return float(record.values["scores"][record.values["encoders"]["judge"]["name"]]["cosine"])


def _utc(moment: datetime) -> datetime:
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def _records(store: Store, folder: Path) -> tuple[dict[str, StepRecord], dict[str, str]]:
    """Every dream of the store by its key, and what is no record."""
    records, damaged = {}, {}
    for key, data in mirrored(store, "artifacts/dream", folder / RECORDS):
        try:
            record = StepRecord.from_json(unseal(data))
            records[record.key] = record
        except DamagedRecord as problem:
            damaged[key] = str(problem)
    return records, damaged


def _of_sweep(store: Store, name: str) -> set[str]:
    record = find_record(store, "sweep", sweep_key(name))
    if record is None:
        raise OrderError(f'expected the name of a sweep in {store.url}, got "{name}": give the name of one that was run there')
    return {entry["key"] for entry in record.values["entries"]}


def _bring_all(
    chosen: Sequence[StepRecord],
    store: Store,
    folder: Path,
    objects: dict[str, dict[str, Any]],
    result: Pulled,
    formats: Sequence[str],
    also: Sequence[str],
    told: Told,
) -> None:
    def one(record: StepRecord) -> tuple[str, str, Any, int]:
        name = record.key
        try:
            want = wanted(record, store, formats=formats, also=also)
            name = want.name
            return name, *_bring(want, store, folder)
        except (MissingArtifact, DamagedArtifact, BadReference) as problem:
            return name, "refused", str(problem), 0

    with ThreadPoolExecutor(AT_ONCE) as pool:
        for name, what, about, moved in pool.map(one, chosen):
            result.moved += moved
            if what == "refused":
                result.refused[name] = about
            else:
                what = what if name in objects else "added"
                objects[name] = about
                getattr(result, what).append(name)
            told(what, name)


def _bring(want: Wanted, store: Store, folder: Path) -> tuple[str, dict[str, Any], int]:
    """What became of one object: (same, changed), what its folder says, bytes moved."""
    place = folder / want.name
    about = read_about(place)
    if about is None or about["made_of"] != want.made_of:
        return "changed", *bring(want, store, place, folder / STAGING)
    kept = {name: about[name] for name in ("made_of", "files")}
    if same_facts({**want.facts, **kept}, about):
        return "same", about, 0
    write_file(place / ABOUT, about_bytes({**want.facts, **kept}))
    return "changed", {**want.facts, **kept}, 0

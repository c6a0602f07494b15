"""One object of a pull: which files it is made of, what is said of it, and how it gets into its folder whole."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.exports import converted, copied, lighter
from flows.slugs import slug
from storage.artifacts import ArtifactRef, get_artifact
from storage.contract import Store
from storage.digests import json_digest, sha256_bytes, sha256_file
from storage.errors import BadReference, DamagedArtifact
from storage.local import explained, make_folder, sync_folder, write_file
from storage.steps import StepRecord

ABOUT = "object.json"
"""In every object's folder: the facts, and the digest of each file."""
EXPORT = 1
"""Raised when a format makes other files of the same mesh, so that they are made again."""
SAFE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
"""A name from a record goes nowhere but into the object's folder."""


@dataclass(frozen=True)
class Wanted:
    """What an object's folder shall hold. copies: artifacts as they are. exports: formats made of mesh.glb and of the lighter ones."""

    name: str
    facts: dict[str, Any]
    copies: tuple[ArtifactRef, ...]
    exports: tuple[str, ...]
    mesh: ArtifactRef
    lighter: tuple[ArtifactRef, ...] = ()

    @property
    def made_of(self) -> str:
        """A digest over all that decides the files."""
        copies = {ref.name: ref.sha256 for ref in self.copies}
        sources = {"mesh": self.mesh.sha256} | {ref.name: ref.sha256 for ref in self.lighter if self.exports}
        return json_digest({"copies": copies, "exports": dict.fromkeys(self.exports, EXPORT), **sources})


def wanted(record: StepRecord, store: Store, *, formats: Sequence[str], also: Sequence[str]) -> Wanted:
    """What to pull of a dream. Raises: BadReference for a record without a mesh, or with a name that is none."""
    outputs = {ref.name: ref for ref in record.outputs}
    copies = [*copied(record.outputs, formats), *(ref for ref in record.outputs if ref.name in also)]
    odd = [ref.name for ref in copies if not SAFE.fullmatch(ref.name) or ref.name == ABOUT]
    if odd or "mesh.glb" not in outputs:
        raise BadReference(f"Expected a dream with mesh.glb and plain file names, got {odd or sorted(outputs)}: dream it again.")
    try:
        name, told = slug(str(record.inputs["caption"]), record.key), facts(record, store)
    except (KeyError, TypeError, AttributeError) as problem:
        raise BadReference(f"Expected the record of a dream at {record.key[:12]}, got one without {problem}: dream it again.") from problem
    return Wanted(
        name,
        told,
        tuple(sorted(copies, key=lambda ref: ref.name)),
        tuple(sorted(set(formats) - {"glb"})),
        outputs["mesh.glb"],
        tuple(lighter(record.outputs)),
    )


def facts(record: StepRecord, store: Store) -> dict[str, Any]:
    """What a pipeline sorts by and an artist asks."""
    values = record.values
    return {
        "caption": record.inputs["caption"],
        "seed": values["seed"],
        "preset": values["preset"],
        "record": record.key,
        "store": store.url,
        "created": record.created,
        "config_digest": values["config_digest"],
        "code_version": record.code_version,
        "encoders": {role: values["encoders"][role] for role in ("guidance", "judge")},
        "scores": {
            judge: {name: score[name] for name in ("cosine", "rank", "correct", "pool") if name in score}
            for judge, score in values["scores"].items()
        },
        "mesh": values["mesh"].get("mesh", {}),
        "fidelity": values["mesh"].get("fidelity", {}),
    }


def read_about(folder: Path) -> dict[str, Any] | None:
    """What the folder says of itself, if it is whole: every file is there and fits its digest."""
    try:
        about: dict[str, Any] = json.loads((folder / ABOUT).read_bytes())
        for name, file in about["files"].items():
            path = folder / name
            if path.stat().st_size != file["size"] or sha256_file(path) != file["sha256"]:
                return None
        return about
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def same_facts(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """But for the time: a dream that is asked for again is stamped anew, and is still the same."""
    return {**one, "created": ""} == {**other, "created": ""}


def bring(want: Wanted, store: Store, folder: Path, staging: Path) -> tuple[dict[str, Any], int]:
    """Fetch, verify, and put into place; what the folder then says of itself, and how many bytes the store was asked for.

    A new folder appears at once, with all its files. In one that is there each file is replaced whole, and files of others
    (an engine's, beside ours) are left alone. Raises: MissingArtifact, DamagedArtifact (also where no other format can be made
    of a mesh), StorageFull, StoreNotWritable.
    """
    files, moved = _fetch(want, store)
    about = {
        **want.facts,
        "made_of": want.made_of,
        "files": {name: {"sha256": sha256_bytes(data), "size": len(data)} for name, data in sorted(files.items())},
    }
    files[ABOUT] = about_bytes(about)  # last, so that it never speaks of files that are not there yet
    aside = staging / f"{want.name}-{os.getpid()}"
    try:
        for name, data in files.items():
            write_file(aside / name, data)
        _publish(aside, folder, list(files))
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    return about, moved


def about_bytes(about: dict[str, Any]) -> bytes:
    """The file `object.json`; the same facts give the same bytes."""
    return (json.dumps(about, indent=2, sort_keys=True, ensure_ascii=False) + "\n").encode()


def _fetch(want: Wanted, store: Store) -> tuple[dict[str, bytes], int]:
    files = {ref.name: get_artifact(store, ref) for ref in want.copies}
    if not want.exports:
        return files, sum(map(len, files.values()))
    sources = {ref.name: files.get(ref.name) or get_artifact(store, ref) for ref in (want.mesh, *want.lighter)}
    moved = {**files, **sources}
    try:
        return files | converted(sources, want.exports), sum(map(len, moved.values()))
    except ValueError as problem:  # a BadMesh, whose import takes seconds
        raise DamagedArtifact(f"Expected a mesh to make {', '.join(want.exports)} of in {want.name}, but {problem}.") from problem


def _publish(aside: Path, folder: Path, names: Sequence[str]) -> None:
    with explained(folder, 0):
        make_folder(folder.parent)
        if not folder.exists():
            os.rename(aside, folder)
            sync_folder(folder.parent)
            return
        for name in names:
            os.replace(aside / name, folder / name)
        sync_folder(folder)

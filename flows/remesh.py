"""A stored dream meshed again with other settings, without dreaming it again."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from dreamfields_core.config import DreamConfig, override, parts, validate
from flows.display import Display
from flows.exports import check_formats, files_of
from flows.order import OrderError, address_of, dream_key
from flows.recipe import Plainly
from flows.slugs import slug
from storage.artifacts import ArtifactRef, is_present, put_artifact
from storage.contract import Store
from storage.digests import sha256_file
from storage.errors import BadReference
from storage.local import write_file
from storage.steps import StepRecord, read_records
from storage.store import open_store
from tasks.step import Place
from tasks.steps import MESH, OPTIMIZE

FIELD = "field.safetensors"


@dataclass(frozen=True)
class Dreamt:
    """A finished dream, as far as a mesh needs it. guide: digest of the model that guided it."""

    caption: str
    config: DreamConfig
    field: ArtifactRef
    guide: str
    store: Store

    @property
    def name(self) -> str:
        """For a folder."""
        return slug(self.caption, dream_key(self.caption, self.config))


def remesh(run: str, *, store: str | None = None, formats: Sequence[str], settings: Sequence[str], out: Path | None = None) -> list[Path]:
    """Mesh a dream with changed settings, by the same step and cache as the dream itself; the files written.

    run: a dream's folder, or in the store the beginning of its record's key, or its caption. store: by default of a folder its own,
    else the user's. settings: part.key=value. out: folder of the files, by default one named after the dream.

    Raises:
      OrderError, ConfigError: before any work. MeshError, StorageError.
    """
    check_formats(formats)
    dreamt = find(run, store)
    config = override(dreamt.config, tuple(settings))
    if parts(config, OPTIMIZE.reads) != parts(dreamt.config, OPTIMIZE.reads):
        raise OrderError(f"expected settings of the mesh (mesh.*), got {', '.join(settings)}: others change the field, so dream it again")
    with Display(Console(highlight=False), steps=config.optim.steps) as display:
        done = Plainly(Place(dreamt.store, display), config)(MESH, field=dreamt.field, caption=dreamt.caption, guide=dreamt.guide)
    folder = out or Path(dreamt.name)
    files = files_of(done.record.outputs, dreamt.store, formats)
    for name, data in files.items():
        write_file(folder / name, data)
    return [folder / name for name in files]


def find(run: str, store: str | None = None) -> Dreamt:
    """The dream that is meant. Raises: OrderError."""
    if os.path.isfile(Path(run) / "result.json"):  # a caption may be too long for Path.is_file
        return _in_folder(Path(run), store)
    opened = open_store(address_of(store, Path("dreams")))
    records = list(read_records(opened, "dream"))
    meant = [record for record in records if re.fullmatch(r"[0-9a-f]{6,64}", run) and record.key.startswith(run)]
    meant = meant or [record for record in records if str(record.inputs["caption"]).casefold() == run.strip().casefold()]
    if len(meant) == 1:
        return _recorded(meant[0], opened)
    if not meant:
        raise OrderError(
            f"expected a dream's folder, or a record's key or a caption in {opened.url}, got \"{run[:80]}\": name one that is there"
        )
    keys = ", ".join(f"{record.key[:12]} (seed {record.values['seed']})" for record in meant[:8])
    raise OrderError(f'expected one dream, but {len(meant)} are called "{run[:80]}": name one by its key, {keys}')


def _recorded(record: StepRecord, store: Store) -> Dreamt:
    guide = record.values["encoders"]["guidance"]["digest"]
    return Dreamt(str(record.inputs["caption"]), validate(record.config), record.output(FIELD), guide, store)


def _in_folder(folder: Path, named: str | None) -> Dreamt:
    """By result.json, in the store that was named, else in its own; where the field is not there, the folder's own copy takes its place."""
    try:
        said = json.loads((folder / "result.json").read_bytes())
        (field,) = (ArtifactRef.from_json(ref) for ref in said["artifacts"] if ref["name"] == FIELD)
        guide, store = said["encoders"]["guidance"]["digest"], open_store(named or said["store"])
        dreamt = Dreamt(said["caption"], validate(said["config"]), field, guide, store)
    except (ValueError, KeyError, TypeError, BadReference) as problem:
        raise OrderError(f"expected the result.json of a dream in {folder}, got one that is none ({problem}): dream it again") from None
    copy = folder / FIELD
    if not is_present(store, field) and copy.is_file() and sha256_file(copy) == field.sha256:
        put_artifact(store, FIELD, copy.read_bytes(), field.media_type)
    return dreamt

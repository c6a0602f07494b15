"""A sweep in the store: who belongs to it, what is there, and what came of it as a report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dreamfields_core.reporting.contract import Entry
from flows.order import folder_name, sweep_key
from flows.report import POSTER, lay_out, read_history
from flows.result import SCORED, find_dream, find_made, told
from flows.slugs import plain_name
from flows.sweep_plan import Cell, Plan
from storage.artifacts import ArtifactRef, export
from storage.contract import Store
from storage.errors import DamagedArtifact, MissingArtifact
from storage.steps import StepRecord, find_record, put_record
from tasks.version import code_version

TRUTHS = "true pictures"
"""The variant of the row in which nothing had to be dreamed."""


@dataclass(frozen=True)
class Member:
    """One object of a sweep. key: of its record in the store (flows/result.py); None where `error` says why there is none."""

    variant: str
    caption: str
    seed: int
    key: str | None
    error: str | None = None


def missing(plan: Plan, store: Store) -> list[Cell]:
    """The cells that are still to be dreamed: what is cached is not even scheduled."""
    return [cell for cell in plan.cells if cell.order and find_dream(store, cell.order) is None]


def keep_sweep(
    plan: Plan, store: Store, errors: Mapping[str, str] | None = None, oracle: Sequence[dict[str, Any]] | None = None
) -> StepRecord:
    """Write down who belongs to the sweep.

    Args:
      errors: by key, the sentences of those that failed; None leaves what was written down before.
      oracle: scores of true pictures; None leaves those of before.
    """
    before = find_record(store, "sweep", sweep_key(plan.name))
    said = errors if errors is not None else {one.key: one.error for one in members(before) if one.key and one.error} if before else {}
    pictures = oracle if oracle is not None else before.values["oracle"] if before else ()
    entries = [vars(Member(cell.variant, cell.caption, cell.seed, cell.key, cell.error or said.get(cell.key or ""))) for cell in plan.cells]
    return put_record(
        store,
        StepRecord(
            step="sweep",
            version=1,
            key=sweep_key(plan.name),
            inputs={"captions": plan.captions.digest},
            code_version=code_version(),
            values={
                "name": plan.name,
                "source": plan.captions.name,
                "table": plan.table.name if plan.table else None,
                "preset": plan.preset,
                "judges": list(plan.judges),
                "entries": entries,
                "oracle": list(pictures),
            },
        ),
    )


def sweeps(store: Store) -> list[StepRecord]:
    """Every sweep of the store, the newest first."""
    keys = [key.rsplit("/", 1)[-1].removesuffix(".json") for key in store.list("artifacts/sweep")]
    return sorted((record for key in keys if (record := find_record(store, "sweep", key))), key=lambda record: record.created, reverse=True)


def members(record: StepRecord) -> list[Member]:
    """The objects of a sweep."""
    return [Member(**entry) for entry in record.values["entries"]]


def entries(record: StepRecord, store: Store, out: Path) -> Iterator[Entry]:
    """True pictures and objects of a sweep as the report takes them; the files that it shows are laid out below `out`.

    What is neither there nor has failed has not been reached yet.
    """
    yield from truths(record, store, out)
    for member in members(record):
        found = find_made(store, member.key, digests=False) if member.key else None
        if found is None or (found.step == SCORED and member.error):
            yield Entry(member.variant, member.caption, member.seed, error=member.error or "not dreamed yet")
        else:
            files = lay_out(found, store, out, folder_name(member.caption, found.key))
            yield Entry(member.variant, member.caption, member.seed, told(found, store), files=files, history=read_history(found, store))


def truths(record: StepRecord, store: Store, out: Path) -> Iterator[Entry]:
    """The row of true pictures; one that the store has lost costs its picture only."""
    for truth in record.values["oracle"]:
        ref = ArtifactRef.from_json(truth["poster"])
        path, files = Path(TRUTHS, f"{plain_name(truth['caption'])}-{ref.sha256[:8]}.webp"), {}
        with suppress(MissingArtifact, DamagedArtifact):
            export(store, ref, out / path)
            files[POSTER] = path.as_posix()
        yield Entry(TRUTHS, truth["caption"], 0, {"scores": truth["scores"]}, files=files)

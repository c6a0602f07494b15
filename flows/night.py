"""One night's evaluation of what a sweep has made: judged again from what is stored, and compared with the last time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from dreamfields_core.config import DreamConfig, validate
from dreamfields_core.reporting.contract import SOURCES, Entry, Night
from dreamfields_core.reporting.statistics import compare
from flows.recipe import Conductor, Remains, judge_object
from flows.result import find_made, told_score
from flows.sweep_record import TRUTHS, Member
from storage.contract import Store
from storage.digests import json_digest
from storage.steps import StepRecord, find_record, put_record
from tasks.pools import keep_pool
from tasks.step import Done, Input, Step
from tasks.steps import MESH_SCORE, SCORE, VIEWS
from tasks.version import code_version

Scores = dict[str, Any]
"""By judge, as result.json has them."""


class Gone(RuntimeError):
    """An object whose files are missing or damaged; the text says which."""


class Anew:
    """Conducts only what judging needs, and scores again whatever this code has not scored yet."""

    def __init__(self, conduct: Conductor) -> None:
        self._conduct = conduct

    def __call__(self, step: Step, **inputs: Input) -> Done:
        assert step in (VIEWS, SCORE, MESH_SCORE), f"a night dreams nothing, but was asked for {step.name}"
        return self._conduct(step, **inputs, **({} if step is VIEWS else {"code": code_version()}))

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        done = self(step, **inputs)
        return lambda: done

    def has(self, step: Step, **inputs: Input) -> bool:
        return self._conduct.has(step, **inputs)

    def under(self, config: DreamConfig) -> Anew:
        return Anew(self._conduct.under(config))


def judge_again(store: Store, key: str, judges: Sequence[str], conductor: Callable[[DreamConfig], Conductor]) -> Scores:
    """What the judges say of a stored object, its own ones and these.

    Raises: Gone, EncoderError, StorageError.
    """
    record = find_made(store, key)
    if record is None:
        raise Gone("its files are missing or damaged: dream it again, what is left of it will be used")
    config, said = validate(record.config), record.values
    pool = keep_pool(store, said.get("among", ()))
    files = {ref.name: ref for ref in record.outputs}
    optional = files.get("glimpses.npz"), files.get("mesh.glb")
    made = Remains(record.inputs["caption"], files["field.safetensors"], files["views.npz"], *optional, pool)
    names = dict.fromkeys([*said["scores"], *judges])
    return {name: told_score(judge_object(Anew(conductor(config)), made, config, name).values) for name in names}


def judged(entries: Sequence[Entry], found: Mapping[str, Scores], members: Sequence[Member]) -> list[Entry]:
    """The entries of a report with tonight's scores, by the key of the object, in place of those that were stored."""
    scores = {(member.variant, member.caption, member.seed): found.get(member.key or "") for member in members}
    return list(_judged(entries, scores))


def _judged(entries: Sequence[Entry], scores: Mapping[tuple[str, str, int], Scores | None]) -> Iterator[Entry]:
    for entry in entries:
        tonight = scores.get((entry.variant, entry.caption, entry.seed))
        yield replace(entry, result={**entry.result, "scores": tonight}) if entry.result and tonight else entry


@dataclass(frozen=True)
class Comparison:
    """night: None where there was none before. lost: objects that a judge recognised then and does not now, in words."""

    night: Night | None
    lost: tuple[str, ...] = ()

    @property
    def fell(self) -> list[str]:
        """What fell by more than its standard error, in words."""
        changes = self.night.changes if self.night else ()
        return [
            f"{change.variant}, {change.judge}, {change.pool} pool, {change.source}: {change.before:.1%} to {change.now:.1%}"
            for change in changes
            if change.fell
        ]


def remember(store: Store, sweep: str, entries: Sequence[Entry], judges: Sequence[str]) -> Comparison:
    """Compare with the last night of this sweep, and write this one down for the next."""
    before = last_night(store, sweep)
    told = [
        {"variant": entry.variant, "caption": entry.caption, "seed": entry.seed, "scores": _brief(entry.result["scores"])}
        for entry in entries
        if entry.result and entry.variant != TRUTHS
    ]
    now = datetime.now(UTC).isoformat(timespec="microseconds")
    values: dict[str, Any] = {"sweep": sweep, "night": now, "entries": told}
    put_record(store, StepRecord("night", 1, json_digest([sweep, now]), code_version=code_version(), values=values))
    if before is None:
        return Comparison(None)
    old, new = ([_entry(one) for one in night["entries"]] for night in (before, values))
    changes = compare(old, new, judges)
    return Comparison(Night(before["night"][:10], changes), tuple(_lost(old, new, judges)))


def last_night(store: Store, sweep: str) -> dict[str, Any] | None:
    """What was written down last of this sweep."""
    keys = [key.rsplit("/", 1)[-1].removesuffix(".json") for key in store.list("artifacts/night")]
    nights = [record.values for key in keys if (record := find_record(store, "night", key)) and record.values["sweep"] == sweep]
    return max(nights, key=lambda night: str(night["night"]), default=None)


def _brief(scores: Scores) -> Scores:
    """What a comparison needs of them."""
    kept = ("similarity", "rank", "correct")
    return {
        judge: {
            source: {pool: {name: found[name] for name in kept} for pool, found in said[source].items()}
            for source in SOURCES
            if source in said
        }
        for judge, said in scores.items()
    }


def _entry(told: Mapping[str, Any]) -> Entry:
    return Entry(told["variant"], told["caption"], told["seed"], {"scores": told["scores"]})


def _lost(old: Sequence[Entry], new: Sequence[Entry], judges: Sequence[str]) -> Iterator[str]:
    before = {(entry.variant, entry.caption, entry.seed): entry for entry in old}
    for entry in new:
        earlier = before.get((entry.variant, entry.caption, entry.seed))
        for judge in judges:
            then, now = (_recognised(one, judge) for one in (earlier, entry))
            if then and now is False:
                yield f"{entry.caption} ({entry.variant}, seed {entry.seed}), {judge}"


def _recognised(entry: Entry | None, judge: str) -> bool | None:
    said = (entry.result or {}).get("scores", {}).get(judge) if entry else None
    return bool(said["field"]["random"]["correct"]) if said else None

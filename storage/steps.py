"""The record of a finished step, `artifacts/<step>/<key>.json`: what was made, from what, by which code, in what time.

A record counts only while every output is there and fits its digest, so a lost or damaged file means "make it again",
never a failure. The intended use, with the lock so that two processes compute once:

    with step_lock(store, key):
        record = find_record(store, "mesh", key) or put_record(store, make())
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from storage.artifacts import ArtifactRef, is_intact, is_present
from storage.contract import Store
from storage.errors import BadReference, DamagedRecord, MissingObject
from storage.locks import step_lock
from storage.sealed import seal, unseal

__all__ = ["StepRecord", "find_record", "put_record", "read_records", "record_key", "step_lock"]
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class StepRecord:
    """Provenance and results of one step; everything in it is JSON."""

    step: str  # the step's name: encode, optimize, ...
    version: int | str  # the step's own version: raised when its meaning changes
    key: str  # the cache key
    config: dict[str, Any] = field(default_factory=dict)  # only the parts that the step reads
    inputs: dict[str, Any] = field(default_factory=dict)  # digests of what came in
    code_version: str = ""
    seconds: float = 0.0
    created: str = ""  # UTC, ISO 8601; filled in by put_record
    outputs: tuple[ArtifactRef, ...] = ()
    values: dict[str, Any] = field(default_factory=dict)  # small results that need no file

    def output(self, name: str) -> ArtifactRef:
        """The output called `name`. Raises: KeyError with the names there are."""
        for ref in self.outputs:
            if ref.name == name:
                return ref
        raise KeyError(f"Expected an output called {name!r}, got {[ref.name for ref in self.outputs]}: use one of these.")

    def to_json(self) -> dict[str, Any]:
        """A plain dict."""
        return {**vars(self), "outputs": [ref.to_json() for ref in self.outputs]}

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> "StepRecord":
        """The inverse of `to_json`. Raises: DamagedRecord."""
        try:
            return cls(**{**value, "outputs": tuple(ArtifactRef.from_json(ref) for ref in value["outputs"])})
        except (TypeError, KeyError, BadReference) as problem:
            raise DamagedRecord(f"Expected the fields of a step record, got others ({problem}): make it again.") from problem


def record_key(step: str, key: str) -> str:
    """Where the record of a step lies in a store."""
    return f"artifacts/{step}/{key}.json"


def put_record(store: Store, record: StepRecord) -> StepRecord:
    """Keep `record` (replacing an earlier one) and return it as kept. Put its artifacts first. Raises: NotJson."""
    stamped = record if record.created else replace(record, created=datetime.now(UTC).isoformat(timespec="seconds"))
    data = seal(stamped.to_json())
    store.put(record_key(record.step, record.key), data)
    return StepRecord.from_json(unseal(data))


def read_records(store: Store, step: str) -> Iterator[StepRecord]:
    """Every record of a step, by key; its outputs are not looked at. A damaged one is passed over, with a warning."""
    for key in store.list(f"artifacts/{step}"):
        try:
            yield StepRecord.from_json(unseal(store.get(key)))
        except MissingObject:
            continue  # deleted while we were looking
        except DamagedRecord as problem:
            log.warning("The record at %s is passed over: %s", store.locate(key), problem)


def find_record(store: Store, step: str, key: str, *, digests: bool = True) -> StepRecord | None:
    """The record, if it and every output are intact; otherwise None, with a warning that says what was wrong.

    `digests=False` trusts the sizes of the outputs, which costs one small request each instead of a read.
    """
    try:
        record = StepRecord.from_json(unseal(store.get(record_key(step, key))))
    except MissingObject:
        return None
    except DamagedRecord as problem:
        log.warning("The record of %s at %s is damaged, so the step is done again: %s", step, store.locate(record_key(step, key)), problem)
        return None
    if (record.step, record.key) != (step, key):
        log.warning("The record at %s belongs to %s/%s, so %s is done again.", record_key(step, key), record.step, record.key, step)
        return None
    for ref in record.outputs:
        if not is_present(store, ref) or (digests and not is_intact(store, ref)):
            state = "missing" if store.head(ref.key) is None else "damaged"
            log.warning("%s, made by %s, is %s at %s, so the step is done again.", ref.name, step, state, store.locate(ref.key))
            return None
    return record

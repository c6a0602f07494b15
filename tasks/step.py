"""The one caching rule: what a step's key is made of, and how a step is done at most once.

A key is a sha256 over the step's name and version, the parts of the configuration that the step reads, and the digests of
what comes in. The record under that key in the store is the truth: it counts while every output is there and fits its digest,
so what vanished or was damaged is made again. Steps run with or without a conductor and give the same artifacts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dreamfields_core.config import DreamConfig, parts
from dreamfields_core.guidance.tokens import cuts_told
from storage.artifacts import ArtifactRef, get_artifact, put_artifact
from storage.contract import Store
from storage.digests import json_digest
from storage.steps import StepRecord, find_record, put_record, step_lock
from tasks.version import code_version

Input = str | int | ArtifactRef
Event = dict[str, Any]
"""JSON-able; `event` says what happened, the rest is about it."""
Report = Callable[[Event], None]


def silent(event: Event) -> None:
    """A report that nobody reads."""


class StopRequest:
    """How somebody outside asks the long step to save and end. Made known by `on_request`, asked for by `request`."""

    def __init__(self) -> None:
        self._heard_by: list[Callable[[], None]] = []

    @contextmanager
    def on_request(self, callback: Callable[[], None]) -> Iterator[None]:
        """Within the block, a request calls this, on the thread of the one who asks."""
        self._heard_by.append(callback)
        try:
            yield
        finally:
            self._heard_by.remove(callback)

    def request(self) -> bool:
        """Ask; False when nobody works on anything that would be lost."""
        for callback in (heard_by := list(self._heard_by)):
            callback()
        return bool(heard_by)


@dataclass(frozen=True)
class Place:
    """Where steps run: where they keep things, whom they tell, where a picture may be shown meanwhile, and who can stop them."""

    store: Store
    report: Report = silent
    preview: Path | None = None
    stop: StopRequest = field(default_factory=StopRequest)


@dataclass(frozen=True)
class Made:
    """What a step has made: files in the store, and small results that need none. seconds: where it was resumed, in all."""

    outputs: tuple[ArtifactRef, ...] = ()
    values: dict[str, Any] = field(default_factory=dict)
    seconds: float | None = None


@dataclass(frozen=True)
class Work:
    """What a step is given: its configuration, what comes in, its key, and the place."""

    place: Place
    config: DreamConfig
    inputs: Mapping[str, Input]
    key: str

    def read(self, name: str) -> bytes:
        """The bytes of an artifact that came in. Raises: MissingArtifact, DamagedArtifact."""
        return get_artifact(self.place.store, self._ref(name))

    def text(self, name: str) -> str:
        """A text that came in."""
        return str(self.inputs[name])

    def number(self, name: str) -> int:
        """A count that came in."""
        return int(str(self.inputs[name]))

    def digest(self, name: str) -> str:
        """The digest of an artifact that came in."""
        return self._ref(name).sha256

    def keep(self, name: str, data: bytes, media_type: str) -> ArtifactRef:
        """Put a file into the store. Raises: StorageFull, StoreNotWritable, StoreUnreachable."""
        return put_artifact(self.place.store, name, data, media_type)

    def _ref(self, name: str) -> ArtifactRef:
        ref = self.inputs[name]
        assert isinstance(ref, ArtifactRef), f"expected {name} to be an artifact, got {ref!r}"
        return ref


@dataclass(frozen=True)
class Step:
    """name, version: the version is raised when what the step makes of the same input changes. reads: parts of the configuration."""

    name: str
    version: int
    reads: tuple[str, ...]
    run: Callable[[Work], Made]


@dataclass(frozen=True)
class Done:
    """The record of a step that is done, and whether it was already."""

    record: StepRecord
    cached: bool

    def output(self, name: str) -> ArtifactRef:
        """The output of that name. Raises: KeyError."""
        return self.record.output(name)


def key_of(step: Step, config: DreamConfig, inputs: Mapping[str, Input]) -> str:
    """The step's cache key, 64 hexadecimal digits."""
    return json_digest({"step": step.name, "version": step.version, "config": parts(config, step.reads), "inputs": _digests(inputs)})


def is_done(step: Step, place: Place, config: DreamConfig, inputs: Mapping[str, Input]) -> bool:
    """Whether the store has the step whole."""
    return find_record(place.store, step.name, key_of(step, config, inputs)) is not None


def perform(step: Step, place: Place, config: DreamConfig, inputs: Mapping[str, Input]) -> Done:
    """Do the step, unless it is done; of several processes that are asked at once, one does it and the others wait.

    Raises: whatever the step raises, StorageError.
    """
    key = key_of(step, config, inputs)

    def tell(sentence: str) -> None:
        place.report({"event": "note", "step_name": step.name, "text": sentence})

    with step_lock(place.store, f"{step.name}-{key}", on_wait=tell):
        known = find_record(place.store, step.name, key)
        if known is not None:
            return Done(known, cached=True)
        begun = time.monotonic()
        cuts: dict[str, None] = {}  # a set that keeps the order
        with cuts_told(lambda sentence: cuts.update({sentence: None})):
            made = step.run(Work(place, config, inputs, key))
        if cuts:
            tell(next(iter(cuts)) + (f" ({len(cuts) - 1} more wordings or captions are cut too)" if len(cuts) > 1 else ""))
        record = StepRecord(
            step=step.name,
            version=step.version,
            key=key,
            config=parts(config, step.reads),
            inputs=_digests(inputs),
            code_version=code_version(),
            seconds=round(time.monotonic() - begun, 3) if made.seconds is None else made.seconds,
            outputs=made.outputs,
            values=made.values,
        )
        return Done(put_record(place.store, record), cached=False)


def _digests(inputs: Mapping[str, Input]) -> dict[str, str | int]:
    return {name: value.sha256 if isinstance(value, ArtifactRef) else value for name, value in inputs.items()}

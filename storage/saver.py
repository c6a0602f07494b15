"""Checkpoints written while the training goes on: one thread, one save at a time, no error lost."""

import json
import logging
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any

import numpy as np

from storage.checkpoints import CheckpointWriter, Manifest
from storage.digests import canonical_json
from storage.errors import StorageError

log = logging.getLogger(__name__)


class AsyncSaver:
    """Saves through `writer` in a thread. An error of a save is raised by the next call: `save`, `wait` or `close`."""

    def __init__(self, writer: CheckpointWriter) -> None:
        self.writer = writer
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="checkpoint")
        self._pending: Future[Manifest] | None = None

    def save(self, step: int, arrays: Mapping[str, Any], metadata: Mapping[str, Any] | None = None) -> None:
        """Copy everything to the host, hand it over, return. Waits first while an earlier save is under way.

        The copy is what makes it safe: the caller may donate or overwrite its buffers as soon as this returns.
        Raises: what the earlier save raised, NotJson.
        """
        self.wait()
        copies = {name: np.array(value, copy=True) for name, value in arrays.items()}
        facts = json.loads(canonical_json(dict(metadata or {})))
        self._pending = self._thread.submit(self.writer.save, step, copies, facts)

    def wait(self) -> Manifest | None:
        """Wait for the save under way and return its manifest; None when there is none. Raises: what it raised."""
        pending, self._pending = self._pending, None
        return pending.result() if pending is not None else None

    def close(self) -> None:
        """Finish the save under way and the thread. Raises: what that save raised."""
        try:
            self.wait()
        finally:
            self._thread.shutdown()

    def __enter__(self) -> "AsyncSaver":
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.close()
        except StorageError as problem:
            if kind is None:
                raise
            log.warning("The last checkpoint was not saved: %s", problem)  # the error under way matters more

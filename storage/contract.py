"""The contract of a store: keys to bytes, whole or absent.

A key is a relative path of plain segments, `runs/red-chair/writer/000001.json`. A prefix names a folder: `runs/a` lists
what is below that folder and never `runs/ab`. All stores pass one test suite (tests/storage/test_store.py).
"""

import os
import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

from storage.errors import AlreadyExists, BadKey

_SEGMENT = re.compile(r"[A-Za-z0-9_=+@-][A-Za-z0-9_=+@.-]{0,199}")  # no leading dot: those names belong to the stores


@dataclass(frozen=True)
class Entry:
    """One listed object: its key, its size in bytes, and when it was last written (seconds since 1970)."""

    key: str
    size: int
    modified: float


def check_key(key: str) -> str:
    """`key`, or BadKey when it is not a clean relative path."""
    if all(_SEGMENT.fullmatch(segment) for segment in key.split("/")):
        return key
    raise BadKey(
        f"Expected a key of letters, digits and '_=+@.-' between single slashes, got {key[:200]!r}: "
        "give a plain relative name without leading dots."
    )


class Store(ABC):
    """Keys to bytes. Every write is whole or absent; after it returns, it survives the end of the process.

    Raises (any method): BadKey, StoreUnreachable. Writing methods also: StorageFull, StoreNotWritable.
    """

    url: str  # open_store(store.url) opens the same place again, except for memory://

    @abstractmethod
    def put(self, key: str, data: bytes) -> None:
        """Write `data` under `key`, replacing what was there in one step."""

    @abstractmethod
    def create(self, key: str, data: bytes) -> None:
        """Write `data` under `key` only if nothing is there.

        An object with the very same bytes counts as ours: a retried request may meet its own first attempt.
        Raises: AlreadyExists when other bytes are there.
        """

    @abstractmethod
    def get(self, key: str) -> bytes:
        """The bytes under `key`. Raises: MissingObject."""

    @abstractmethod
    def head(self, key: str) -> int | None:
        """The size in bytes of the object under `key`, None when there is none."""

    @abstractmethod
    def entries(self, prefix: str = "") -> list[Entry]:
        """Every object below the folder `prefix` ('' is everything), sorted by key."""

    @abstractmethod
    def delete(self, key: str) -> None:
        """Remove the object under `key`; no error when there is none."""

    def list(self, prefix: str = "") -> list[str]:
        """Every key below the folder `prefix`, sorted."""
        return [entry.key for entry in self.entries(prefix)]

    def local_path(self, key: str) -> Path | None:
        """Where `key` lies on this machine's disk (whether or not it exists yet); None for other stores."""
        check_key(key)
        return None

    def locate(self, key: str) -> str:
        """`key` as an address to show to a person."""
        return f"{self.url.rstrip('/')}/{check_key(key)}"

    def check_writable(self) -> None:
        """Try a small write before any work starts. Raises: StoreNotWritable, StorageFull, StoreUnreachable."""
        probe = f"writable-probe-{os.urandom(6).hex()}"
        self.put(probe, b"writable?")
        self.delete(probe)

    def _settle_create(self, key: str, data: bytes) -> None:
        """A create met an object: fine when the bytes are ours."""
        if self.get(key) != data:
            raise AlreadyExists(f"Expected nothing at {self.locate(key)}, but other bytes are there: use a new name, or delete it first.")

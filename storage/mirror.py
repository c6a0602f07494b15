"""Small objects of a store with a copy in a folder, so that what has not changed since the last look is listed but not read again."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from storage.contract import Entry, Store
from storage.errors import MissingObject
from storage.local import write_file

READERS = 16
"""Objects read at once: an object store answers late, but many at a time."""
SAME_TIME = 1e-3
"""Seconds; file systems round times."""


def mirrored(store: Store, prefix: str, folder: Path) -> Iterator[tuple[str, bytes]]:
    """Every object below the folder `prefix` of the store: key and bytes, sorted by key.

    A copy in `folder` counts while its size and its time are the listed ones; copies of what is no longer listed are removed.
    Raises: StoreUnreachable, StorageFull, StoreNotWritable.
    """
    entries = store.entries(prefix)
    names = {_copy_of(entry.key, folder).name for entry in entries}
    for stale in folder.glob("*") if folder.is_dir() else ():
        if stale.name not in names:
            stale.unlink()
    with ThreadPoolExecutor(READERS) as readers:
        found = readers.map(lambda entry: _read(store, entry, _copy_of(entry.key, folder)), entries)
        yield from ((entry.key, data) for entry, data in zip(entries, found) if data is not None)


def _read(store: Store, entry: Entry, copy: Path) -> bytes | None:
    """None for what was deleted while we were looking."""
    if copy.is_file():
        status = copy.stat()
        if status.st_size == entry.size and abs(status.st_mtime - entry.modified) < SAME_TIME:
            return copy.read_bytes()
    try:
        data = store.get(entry.key)
    except MissingObject:
        return None
    write_file(copy, data)
    os.utime(copy, (entry.modified, entry.modified))
    return data


def _copy_of(key: str, folder: Path) -> Path:
    return folder / key.rsplit("/", 1)[-1]

"""A folder as a store: staged, synced, then renamed or linked into place.

A reader sees the old bytes, the new bytes or nothing, whatever instant a process is killed at. Staged files lie in
`<root>/.staging`, are never listed, and are swept an hour later when a writer was killed.
"""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from storage.contract import Entry, Store, check_key
from storage.errors import MissingObject, StorageError, StorageFull, StoreNotWritable, StoreUnreachable
from storage.locks import flock

STAGING = ".staging"
STAGING_AGE = 3600.0  # seconds after which a staged file has no living writer
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG, errno.ENOENT}
_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV}


class LocalStore(Store):
    """Keys are paths below `root`."""

    def __init__(self, root: Path) -> None:
        self.root = Path(os.path.abspath(root.expanduser()))
        self.url = str(self.root)
        self._swept = False

    def put(self, key: str, data: bytes) -> None:
        path = self._path(key)
        with explained(path, len(data)), self._staged(data) as staged:
            make_folder(path.parent)
            os.replace(staged, path)
            sync_folder(path.parent)

    def create(self, key: str, data: bytes) -> None:
        path = self._path(key)
        with explained(path, len(data)), self._staged(data) as staged:
            make_folder(path.parent)
            try:
                _link(staged, path, self.root / STAGING / "create.lock")
            except FileExistsError:
                self._settle_create(key, data)
            sync_folder(path.parent)

    def get(self, key: str) -> bytes:
        path = self._path(key)
        try:
            return path.read_bytes()
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError) as problem:
            raise MissingObject(f"Expected a file at {path}, found none: was it deleted, or is this another store?") from problem
        except OSError as problem:
            raise StoreUnreachable(f"Expected to read {path}, got '{problem.strerror}': check its rights and the disk.") from problem

    def head(self, key: str) -> int | None:
        path = self._path(key)
        return path.stat().st_size if path.is_file() else None

    def entries(self, prefix: str = "") -> list[Entry]:
        top = self._path(prefix) if prefix else self.root
        found = []
        for folder, folders, names in os.walk(top):
            folders[:] = [name for name in folders if not name.startswith(".")]
            for name in names:
                with suppress(FileNotFoundError):  # deleted while we were looking
                    path = Path(folder, name)
                    status = path.stat()
                    found.append(Entry(path.relative_to(self.root).as_posix(), status.st_size, status.st_mtime))
        return sorted((entry for entry in found if not Path(entry.key).name.startswith(".")), key=lambda entry: entry.key)

    def delete(self, key: str) -> None:
        path = self._path(key)
        with explained(path, 0), suppress(FileNotFoundError, NotADirectoryError):
            path.unlink()
            sync_folder(path.parent)

    def local_path(self, key: str) -> Path | None:
        return self._path(key)

    def _path(self, key: str) -> Path:
        return self.root / check_key(key)

    @contextmanager
    def _staged(self, data: bytes) -> Iterator[Path]:
        """`data` in a synced file of its own, gone at the end unless it was renamed."""
        folder = self.root / STAGING
        make_folder(folder)
        if not self._swept:
            self._swept = True
            _sweep(folder, older_than=time.time() - STAGING_AGE)
        path = folder / f"{os.getpid()}-{os.urandom(8).hex()}"
        try:
            write_synced(path, data)
            yield path
        finally:
            with suppress(OSError):
                path.unlink()


def write_file(path: Path, data: bytes) -> None:
    """Write `data` to any path, whole or not at all, through a hidden neighbour. Raises: StorageFull, StoreNotWritable."""
    staged = path.with_name(f".{os.getpid()}-{os.urandom(8).hex()}")
    with explained(path, len(data)):
        make_folder(path.parent)
        try:
            write_synced(staged, data)
            os.replace(staged, path)
            sync_folder(path.parent)
        finally:
            with suppress(OSError):
                staged.unlink()


def write_synced(path: Path, data: bytes) -> None:
    """A new file at `path` whose bytes are on the disk when this returns."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    with open(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(descriptor)


def make_folder(folder: Path) -> None:
    """`folder` and its parents, each entered durably in its parent."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    try:
        folder.mkdir()
    except FileExistsError:
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "a file is where a folder should be", str(folder)) from None
    sync_folder(folder.parent)


def sync_folder(folder: Path) -> None:
    """Make names in `folder` durable; systems that cannot sync a folder are left to themselves."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextmanager
def explained(path: Path, size: int) -> Iterator[None]:
    """Turn the system's errors while writing `size` bytes, 0 where nobody knows, to `path` into ours."""
    try:
        yield
    except StorageError:
        raise
    except OSError as problem:
        said = problem.strerror or str(problem)
        if problem.errno in _FULL:
            raise StorageFull(
                f"Expected room for {f'{size} bytes' if size else 'more'} at {path}, but the disk is full ({said}): "
                "free some space or choose another place; what was saved before is intact."
            ) from problem
        if problem.errno in _REFUSED:
            raise StoreNotWritable(f"Expected to write {path}, but '{said}': choose a folder that you may write.") from problem
        raise StoreUnreachable(f"Expected to write {path}, but '{said}': check the disk.") from problem


def _link(staged: Path, path: Path, lock: Path) -> None:
    """Give `staged` the name `path` if it is free, in one step. Raises: FileExistsError."""
    try:
        os.link(staged, path)
    except FileExistsError:
        raise
    except OSError as problem:
        if problem.errno not in _NO_LINKS:
            raise
        with flock(lock):  # a file system without hard links (exFAT): look and rename, one creator at a time
            if path.exists():
                raise FileExistsError(errno.EEXIST, "exists", str(path)) from None
            os.replace(staged, path)


def _sweep(folder: Path, older_than: float) -> None:
    """Remove what killed writers left in the staging folder."""
    for path in folder.iterdir():
        with suppress(OSError):
            if path.suffix != ".lock" and path.stat().st_mtime < older_than:
                path.unlink()

"""A file from a plain address, once: resumed where it was cut off, its digest written beside it and verified ever after.

For models that are not on the hub. Nobody states a digest for them, so the first download is trusted and every later use must
agree with it; a known digest can be demanded from the start.
"""

import os
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from http.client import HTTPException, HTTPResponse
from pathlib import Path

from storage.digests import sha256_file
from storage.errors import UnreadableWeights
from storage.local import explained, make_folder, write_file
from storage.locks import flock
from storage.published import NoNetwork, NotPublished, Offline

PIECE = 1 << 20
Progress = Callable[[str, int, int | None], None]
"""(name, bytes so far, bytes in all or None)."""


def fetch(address: str, folder: Path, *, sha256: str | None = None, progress: Progress | None = None) -> Path:
    """The file at `address`, in `folder` under its own name; one process at a time fetches it.

    Raises: NoNetwork, Offline, NotPublished, UnreadableWeights, StorageFull, StoreNotWritable.
    """
    path = folder / address.rsplit("/", 1)[-1]
    beside = path.with_name(f"{path.name}.sha256")
    if not path.is_file():
        if os.environ.get("HF_HUB_OFFLINE", "0").upper() in ("1", "TRUE", "YES", "ON"):
            raise Offline(_got_neither(address, path, "HF_HUB_OFFLINE is set"))
        with explained(path, 0):
            make_folder(folder.absolute())
            with flock(path.with_name(f".{path.name}.lock")):
                if not path.is_file():  # nobody else was here first
                    part = _download(address, path, progress or _show)
                    write_file(beside, f"{sha256_file(part)}\n".encode("ascii"))  # first, so that the file is never without it
                    os.replace(part, path)
    expected = sha256 or (beside.read_text(encoding="ascii").strip() if beside.is_file() else None)
    if expected and (found := sha256_file(path)) != expected:
        raise UnreadableWeights(
            f"Expected digest {expected[:12]} for {path}, got {found[:12]}: remove it and {beside.name}, then fetch it again."
        )
    return path


def _download(address: str, path: Path, progress: Progress) -> Path:
    """The whole file, under a name that says it is not verified yet. Raises: NoNetwork, NotPublished, StorageFull, OSError."""
    part = path.with_name(f"{path.name}.part")
    start = part.stat().st_size if part.is_file() else 0
    request = urllib.request.Request(address, headers={"Range": f"bytes={start}-"} if start else {})
    try:
        answer = urllib.request.urlopen(request, timeout=30)
    except urllib.error.HTTPError as problem:
        if problem.code == 416 and start:
            part.unlink()
            return _download(address, path, progress)
        raise NotPublished(
            f"Expected {path.name} at {address}, got '{problem.code} {problem.reason}': put the file into {path.parent}."
        ) from None
    except (OSError, HTTPException) as problem:
        raise _no_network(address, path, problem) from None
    with answer:
        resumed = answer.status == 206
        length = answer.headers.get("Content-Length")
        total = int(length) + (start if resumed else 0) if length else None
        with explained(path, total or 0), part.open("ab" if resumed else "wb") as file:
            for piece in _pieces(answer, address, path):
                file.write(piece)
                progress(path.name, file.tell(), total)
    size = part.stat().st_size
    if total is not None and size != total:
        why = f"the download broke off at {size} of {total} bytes; the next attempt goes on from there"
        raise NoNetwork(_got_neither(address, path, why))
    return part


def _pieces(answer: HTTPResponse, address: str, path: Path) -> Iterator[bytes]:
    """What comes, piece by piece: the network's errors are told apart here from the disk's. Raises: NoNetwork."""
    try:
        while piece := answer.read(PIECE):
            yield piece
    except (OSError, HTTPException) as problem:
        raise _no_network(address, path, problem) from None


def _no_network(address: str, path: Path, problem: Exception) -> NoNetwork:
    return NoNetwork(_got_neither(address, path, str(getattr(problem, "reason", problem))[:120]))


def _got_neither(address: str, path: Path, why: str) -> str:
    return f"Expected {path.name} from {address} or in {path.parent}, got neither ({why}): use --guidance embedded, or put the file there."


def _show(name: str, done: int, total: int | None) -> None:
    """A line on the error stream that grows as the file does, where somebody watches."""
    if sys.stderr.isatty():
        share = f"{done / total:6.1%}" if total else ""
        sys.stderr.write(f"\r{name}: {done / 1e6:.0f} MB {share}" + ("\n" if done == total else ""))
        sys.stderr.flush()

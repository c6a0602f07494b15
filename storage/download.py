"""A file from a plain address, once: resumed where it was cut off, its digest written beside it and verified ever after.

For models that are not on the hub. Nobody states a digest for them, so the first download is trusted and every later use must
agree with it; a known digest can be demanded from the start.
"""

import os
import sys
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from storage.digests import sha256_file
from storage.errors import UnreadableWeights
from storage.published import NoNetwork, NotPublished

PIECE = 1 << 20
Progress = Callable[[str, int, int | None], None]
"""(name, bytes so far, bytes in all or None)."""


def fetch(address: str, folder: Path, *, sha256: str | None = None, progress: Progress | None = None) -> Path:
    """The file at `address`, in `folder` under its own name.

    Raises: NoNetwork, NotPublished, UnreadableWeights.
    """
    path = folder / address.rsplit("/", 1)[-1]
    beside = path.with_name(f"{path.name}.sha256")
    if not path.is_file():
        _download(address, path, progress or _show)
        beside.write_text(sha256_file(path) + "\n", encoding="ascii")
    expected = sha256 or (beside.read_text(encoding="ascii").strip() if beside.is_file() else None)
    if expected and (found := sha256_file(path)) != expected:
        raise UnreadableWeights(
            f"Expected digest {expected[:12]} for {path}, got {found[:12]}: remove it and {beside.name}, then fetch it again."
        )
    return path


def _download(address: str, path: Path, progress: Progress) -> None:
    if os.environ.get("HF_HUB_OFFLINE", "0").upper() in ("1", "TRUE", "YES", "ON"):
        raise _no_network(address, path, "HF_HUB_OFFLINE is set")
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    start = part.stat().st_size if part.is_file() else 0
    request = urllib.request.Request(address, headers={"Range": f"bytes={start}-"} if start else {})
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            resumed = answer.status == 206
            length = answer.headers.get("Content-Length")
            total = int(length) + (start if resumed else 0) if length else None
            with part.open("ab" if resumed else "wb") as file:
                while piece := answer.read(PIECE):
                    file.write(piece)
                    progress(path.name, file.tell(), total)
        size = part.stat().st_size
        if total is not None and size != total:
            raise _no_network(address, path, f"the download broke off at {size} of {total} bytes; the next attempt goes on from there")
    except urllib.error.HTTPError as problem:
        if problem.code == 416 and start:
            part.unlink()
            return _download(address, path, progress)
        raise NotPublished(
            f"Expected {path.name} at {address}, got '{problem.code} {problem.reason}': put the file into {path.parent}."
        ) from None
    except (urllib.error.URLError, ConnectionError, TimeoutError) as problem:
        raise _no_network(address, path, str(getattr(problem, "reason", problem))[:120]) from None
    os.replace(part, path)
    return None


def _no_network(address: str, path: Path, why: str) -> NoNetwork:
    return NoNetwork(
        f"Expected {path.name} from {address} or in {path.parent}, got neither ({why}): use --guidance embedded, or put the file there."
    )


def _show(name: str, done: int, total: int | None) -> None:
    """A line on the error stream that grows as the file does, where somebody watches."""
    if sys.stderr.isatty():
        share = f"{done / total:6.1%}" if total else ""
        sys.stderr.write(f"\r{name}: {done / 1e6:.0f} MB {share}" + ("\n" if done == total else ""))
        sys.stderr.flush()

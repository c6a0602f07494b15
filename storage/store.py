"""`open_store` finds the right store for an address."""

import os
from pathlib import Path
from urllib.parse import unquote, urlsplit

from storage.contract import Entry, Store
from storage.errors import BadAddress
from storage.local import LocalStore

__all__ = ["Entry", "Store", "open_store"]


def open_store(address: str | os.PathLike[str]) -> Store:
    """The store at `address`: a folder (a path or file:///...), s3://bucket/prefix, or memory:// (a new, empty one).

    S3 takes endpoint, region and credentials from the environment: AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID,
    AWS_SECRET_ACCESS_KEY, AWS_ALLOW_HTTP. Nothing is read or written yet: `check_writable` does that.
    Raises: BadAddress.
    """
    text = os.fspath(address)
    scheme = text.split("://", 1)[0] if "://" in text else ""
    if scheme in ("s3", "memory"):
        from storage.objects import memory_store, s3_store  # obstore is loaded by those who need it

        return s3_store(text) if scheme == "s3" else memory_store()
    if scheme not in ("", "file") or not text or "\0" in text:
        raise BadAddress(f"Expected a folder, file:///folder, s3://bucket/prefix or memory://, got {text!r}: give one of these.")
    return LocalStore(Path(unquote(urlsplit(text).path) if scheme else text))

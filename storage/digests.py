"""sha256 of bytes, files and JSON values. A value's digest does not depend on the order in which a dict was built."""

import hashlib
import json
import os
from collections.abc import Mapping
from typing import Any

from storage.errors import NotJson


def sha256_bytes(data: bytes) -> str:
    """The sha256 of `data`, 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def sha256_file(path: str | os.PathLike[str]) -> str:
    """The sha256 of a file, read in pieces. Raises: OSError."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def canonical_json(value: Any) -> bytes:
    """`value` as the one JSON text that stands for it: sorted keys, no spaces, ASCII.

    Tuples become lists; 1 and 1.0 stay different. Raises: NotJson for NaN, infinity, keys that are no strings and
    anything that JSON has no word for.
    """
    _check_keys(value, "the value")
    try:
        return json.dumps(value, sort_keys=True, allow_nan=False, separators=(",", ":")).encode("ascii")
    except (TypeError, ValueError, RecursionError) as problem:
        raise NotJson(f"Expected finite numbers, strings, lists and dicts, got '{problem}': convert or drop that value first.") from problem


def json_digest(value: Any) -> str:
    """The sha256 of `canonical_json(value)`. Raises: NotJson."""
    return sha256_bytes(canonical_json(value))


def _check_keys(value: Any, where: str) -> None:
    """json.dumps would quietly make "1" out of 1, and two keys one."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if not isinstance(key, str):
                raise NotJson(f"Expected string keys in {where}, got {key!r}: turn it into a string first.")
            _check_keys(item, key)
    elif isinstance(value, list | tuple):
        for item in value:
            _check_keys(item, where)

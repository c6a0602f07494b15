"""Which code made something."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("dreamfields_core", "flows", "storage", "tasks")


@cache
def code_version() -> str:
    """The release, and a digest of the sources themselves, so that a working copy is not mistaken for a release."""
    try:
        release = metadata.version("dreamfields")
    except metadata.PackageNotFoundError:
        release = "0"
    return f"{release}+{_sources_digest()[:12]}"


def _sources_digest() -> str:
    digest = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()

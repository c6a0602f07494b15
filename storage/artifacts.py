"""Finished files by content: `blobs/sha256/ab/<sha256>`. A reference is small, travels as JSON, and proves what it names.

References are relative to the store, so a bucket that is copied or renamed keeps them valid.
"""

import os
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from storage.contract import Store
from storage.digests import sha256_bytes, sha256_file
from storage.errors import BadReference, DamagedArtifact, MissingArtifact, MissingObject
from storage.local import write_file

_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class ArtifactRef:
    """What passes between steps: `name` for people, `media_type` for programs, the rest to find and to prove the bytes."""

    name: str
    media_type: str
    uri: str  # cas:sha256/<64 hexadecimal digits>
    sha256: str
    size: int  # bytes

    def __post_init__(self) -> None:
        texts = all(isinstance(text, str) for text in (self.name, self.media_type, self.uri, self.sha256))
        if not (texts and _DIGEST.fullmatch(self.sha256) and self.uri == f"cas:sha256/{self.sha256}"):
            raise BadReference(f"Expected uri 'cas:sha256/<hex>' with the same 64 digits in sha256, got {self.uri!r}: use put_artifact.")
        if type(self.size) is not int or self.size < 0:
            raise BadReference(f"Expected a size in bytes, got {self.size!r}: use put_artifact.")

    @property
    def key(self) -> str:
        """Where the bytes lie in a store."""
        return f"blobs/sha256/{self.sha256[:2]}/{self.sha256}"

    def to_json(self) -> dict[str, Any]:
        """A plain dict of strings and one integer."""
        return asdict(self)

    @classmethod
    def from_json(cls, value: Any) -> "ArtifactRef":
        """The inverse of `to_json`. Raises: BadReference."""
        fields = set(cls.__dataclass_fields__)
        if not isinstance(value, dict) or set(value) != fields:
            raise BadReference(f"Expected a dict with exactly {sorted(fields)}, got {str(value)[:200]}: give an artifact reference.")
        return cls(**value)


def put_artifact(store: Store, name: str, data: bytes, media_type: str) -> ArtifactRef:
    """Keep `data`; bytes that are already there intact are not written again, damaged ones are replaced."""
    digest = sha256_bytes(data)
    ref = ArtifactRef(name, media_type, f"cas:sha256/{digest}", digest, len(data))
    if not is_intact(store, ref):
        store.put(ref.key, data)
    return ref


def get_artifact(store: Store, ref: ArtifactRef) -> bytes:
    """The bytes of `ref`, proven by their digest. Raises: MissingArtifact, DamagedArtifact."""
    try:
        data = store.get(ref.key)
    except MissingObject as problem:
        raise MissingArtifact(f"Expected {ref.name} at {store.locate(ref.key)}, found nothing: run the step again to make it.") from problem
    if len(data) != ref.size or sha256_bytes(data) != ref.sha256:
        raise DamagedArtifact(
            f"Expected {ref.name} with digest {ref.sha256[:12]}, but other bytes are at {store.locate(ref.key)}: run the step again."
        )
    return data


def is_present(store: Store, ref: ArtifactRef) -> bool:
    """Whether an object of the right size is there: one cheap request."""
    return store.head(ref.key) == ref.size


def is_intact(store: Store, ref: ArtifactRef) -> bool:
    """Whether the very bytes are there: reads them all."""
    try:
        return is_present(store, ref) and len(get_artifact(store, ref)) == ref.size
    except (MissingArtifact, DamagedArtifact):
        return False


def export(store: Store, ref: ArtifactRef, path: str | os.PathLike[str]) -> bool:
    """Copy `ref` to a file, whole or not at all; False when the file already holds exactly these bytes.

    Raises: MissingArtifact, DamagedArtifact, StorageFull, StoreNotWritable.
    """
    target = Path(path)
    if target.is_file() and target.stat().st_size == ref.size and sha256_file(target) == ref.sha256:
        return False
    write_file(target, get_artifact(store, ref))
    return True

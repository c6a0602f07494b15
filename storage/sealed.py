"""Small JSON records for people to read, which notice when one of their bytes has changed."""

import json
from collections.abc import Mapping
from typing import Any

from storage.digests import canonical_json, json_digest
from storage.errors import DamagedRecord

CHECKSUM = "checksum"


def seal(payload: Mapping[str, Any]) -> bytes:
    """`payload` as indented JSON with its own checksum; the same payload always gives the same bytes. Raises: NotJson."""
    plain = json.loads(canonical_json(dict(payload)))
    return (json.dumps({**plain, CHECKSUM: json_digest(plain)}, indent=1, sort_keys=True) + "\n").encode("ascii")


def unseal(data: bytes) -> dict[str, Any]:
    """The payload of `seal`. Raises: DamagedRecord when a single byte differs from what `seal` wrote."""
    try:
        payload = json.loads(data)
        payload.pop(CHECKSUM)
        intact = seal(payload) == data
    except Exception as problem:  # whatever broken JSON can lead to
        raise DamagedRecord(f"Expected a sealed JSON record, got {len(data)} bytes that are none ({problem}): make it again.") from problem
    if not intact:
        raise DamagedRecord("Expected a record that fits its checksum, got one that was changed: make it again.")
    return payload

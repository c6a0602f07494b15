"""Where an object comes from, said in its file, or in a JSON file beside it where the format has no room."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from dreamfields_core.meshing.errors import BadMesh

Provenance = Mapping[str, Any]
"""JSON-able: caption, seed, digests, a note on licences."""


def plain(provenance: Provenance) -> dict[str, Any]:
    """The provenance as plain JSON values, keys sorted. Raises: BadMesh for what JSON has no word for, NaN included."""
    try:
        return dict(json.loads(json.dumps(dict(provenance), sort_keys=True, allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise BadMesh(f"expected provenance of plain JSON values, got one that is not ({error}): convert it first") from None


def beside(provenance: Provenance) -> bytes:
    """The provenance as a JSON file. Raises: BadMesh."""
    return (json.dumps(plain(provenance), indent=2, ensure_ascii=False) + "\n").encode()

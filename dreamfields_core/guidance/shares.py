"""The name of an ensemble, "MODEL+MODEL*WEIGHT", and what can be said of one without loading it. JAX is not started."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

SHARE, SIGN = "*", "+"


def split_name(name: str) -> list[tuple[str, float]]:
    """ "clip-vit-b16+siglip2-base-patch16-256*0.5" -> names and weights, 1 where none is given.

    Raises:
      ValueError: a weight that is no positive number, or an empty name.
    """
    parts = []
    for part in name.split(SIGN):
        model, _, share = part.strip().rpartition(SHARE) if SHARE in part else (part.strip(), "", "1")
        try:
            weight = float(share)
        except ValueError:
            weight = -1.0
        if not model.strip() or not 0 < weight < float("inf"):
            raise ValueError(f'expected NAME or NAME*WEIGHT with a positive weight, joined by "+", got "{part}" in "{name}"')
        parts.append((model.strip(), weight))
    return parts


def roots(weights: Sequence[float]) -> list[float]:
    """Square roots of the weights' shares in their sum: what each model's unit vectors are multiplied by."""
    total = sum(weights)
    return [math.sqrt(weight / total) for weight in weights]


def digest(members: Sequence[tuple[str, float]]) -> str:
    """sha256 of an ensemble from its members' digests and weights."""
    said = "\n".join(f"{own} {root!r}" for (own, _), root in zip(members, roots([weight for _, weight in members])))
    return hashlib.sha256(said.encode()).hexdigest()

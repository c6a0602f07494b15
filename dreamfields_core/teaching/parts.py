"""The kinds of things as signed distances, each with random proportions: iconic rather than true, so that 48 pixels suffice.

A kind is a function (rng) -> parts; a part is a distance and what colours it. They stand upright
along Z, within about a unit of the origin.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dreamfields_core.teaching.distances import Distance

BODY, PART = "body", "part"


class Part(NamedTuple):
    """distance: where it is. paint: `BODY`, `PART` (the part that captions may colour) or a colour of `words.COLORS`."""

    distance: Distance
    paint: str


Parts = list[Part]
KINDS: dict[str, Callable[[np.random.Generator], Parts]] = {}


def kind(make: Callable[[np.random.Generator], Parts]) -> Callable[[np.random.Generator], Parts]:
    """Enters a kind under its function's name ('_' reads as a space; one at the end keeps clear of a distance's name)."""
    KINDS[make.__name__.replace("_", " ").strip()] = make
    return make


def body(*solids: Distance) -> Parts:
    """Parts of the main colour."""
    return [Part(solid, BODY) for solid in solids]


def part(*solids: Distance) -> Parts:
    """Parts of the colour that captions may name."""
    return [Part(solid, PART) for solid in solids]

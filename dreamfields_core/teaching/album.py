"""Captioned pictures by the page: each page follows from (seed, page) alone, so that pages can be made in any order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dreamfields_core.teaching import words
from dreamfields_core.teaching.language import Description, Thing, describe, parse
from dreamfields_core.teaching.pictures import SIZE, random_camera, random_light, render
from dreamfields_core.teaching.pools import random_description
from dreamfields_core.teaching.staging import stage

PAGE = 1024
HELD_OUT_ELEVATIONS = (40.0, 50.0)
"""Degrees; no training picture is seen from this band, in which dreams are judged."""


class Page(NamedTuple):
    """pictures: uint8 RGBA [n, size, size, 4], premultiplied. captions: plain captions, one a picture."""

    pictures: np.ndarray
    captions: list[str]


def training_page(seed: int, page: int, *, n: int = PAGE, size: int = SIZE) -> Page:
    """Taught combinations, seen from outside the held-out band."""
    rng = np.random.default_rng([seed, page])
    descriptions = [random_description(rng, held_out=False) for _ in range(n)]
    return Page(np.stack([picture(rng, d, gap=HELD_OUT_ELEVATIONS, size=size) for d in descriptions]), [describe(d) for d in descriptions])


def examination(descriptions: Sequence[Description], *, seed: int, size: int = SIZE) -> np.ndarray:
    """One picture of each description from the held-out band, uint8 RGBA [n, size, size, 4]."""
    rng = np.random.default_rng([seed, 0xE8A])
    return np.stack([picture(rng, d, elevations=HELD_OUT_ELEVATIONS, size=size) for d in descriptions])


def picture(
    rng: np.random.Generator,
    description: Description,
    *,
    elevations: tuple[float, float] = (0.0, 60.0),
    gap: tuple[float, float] | None = None,
    size: int = SIZE,
) -> np.ndarray:
    """One picture with random proportions, camera and light, uint8 RGBA [size, size, 4]."""
    sized = description.thing.size is not None
    return render(stage(rng, description), random_camera(rng, elevations=elevations, gap=gap, sized=sized), random_light(rng), size=size)


FACTS: dict[str, tuple[str, ...]] = {
    "kind": tuple(words.KINDS),
    "color": tuple(words.COLORS),
    "part_color": ("-", *words.COLORS),
    "pattern": ("-", *words.PATTERNS),
    "size": ("-", *words.SIZES),
    "relation": ("-", *words.RELATIONS),
    "other_kind": ("-", *words.KINDS),
    "other_color": ("-", *words.COLORS),
}
"""What is asked of a picture beside its caption, and the answers, in order."""


def facts(description: Description) -> np.ndarray:
    """The answers' indices int32 [8] in the order of `FACTS`; -1 where the caption leaves it open or the question does not apply."""
    thing, other = description.thing, description.other or Thing("-", "-")
    said = {
        "kind": thing.kind,
        "color": thing.color,
        "part_color": thing.part_color or "-",
        "pattern": thing.pattern or "-",
        "size": thing.size or "-",
        "relation": description.relation or "-",
        "other_kind": other.kind,
        "other_color": other.color,
    }
    if description.relation == "next to":  # which of the two is first, no picture can tell: ask for them in the order of the list
        pairs = sorted([(thing.kind, thing.color), (other.kind, other.color)], key=lambda pair: FACTS["kind"].index(pair[0]))
        said["kind"], said["color"], said["other_kind"], said["other_color"] = *pairs[0], *pairs[1]
    return np.array([options.index(said[name]) if said[name] in options else -1 for name, options in FACTS.items()], np.int32)


def descriptions_of(captions: Sequence[str]) -> list[Description]:
    """The descriptions that plain captions tell."""
    return [parse(caption) for caption in captions]

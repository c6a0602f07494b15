"""From a description to things that stand somewhere: proportions, size, place and paint."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dreamfields_core.teaching import words
from dreamfields_core.teaching.distances import Distance, at, scaled
from dreamfields_core.teaching.language import Description, Thing
from dreamfields_core.teaching.solids import BODY, KINDS, PART

SCALES = {None: (0.8, 1.0), "small": (0.38, 0.5), "large": (1.15, 1.3)}
"""Half-size of a thing, in units of the scene's half-side."""


Parts = Sequence[tuple[Distance, str]]
Shapes = Mapping[str, Callable[[np.random.Generator], Parts]]
Paints = tuple[np.ndarray, np.ndarray, np.ndarray, str | None]
Box = tuple[np.ndarray, np.ndarray]
"""Lower and upper corner, [3] each."""
Stand = tuple[float, np.ndarray]
"""Scale and centre [3]."""


class Solid(NamedTuple):
    """distance: placed in the scene. color: [3] in [0, 1]. second: [3], the pattern's other colour.

    pattern: None, or a key of `words.PATTERNS`.
    frame: (centre [3], scale): pattern coordinates are (p - centre) / scale.
    """

    distance: Distance
    color: np.ndarray
    second: np.ndarray
    pattern: str | None
    frame: tuple[np.ndarray, float]


def stage(rng: np.random.Generator, description: Description, *, shapes: Shapes = KINDS) -> list[Solid]:
    """The solids of a scene about the origin, Z up. shapes: kind -> (rng) -> parts."""
    if description.other is None:
        low, high = SCALES[description.thing.size]
        return _solids(*_make(rng, description.thing, shapes), rng.uniform(low, high), np.zeros(3))
    things = [_make(rng, thing, shapes) for thing in (description.thing, description.other)]
    boxes = [_bounds([part for part, _ in parts]) for parts, _ in things]
    first, second = (_on_top if description.relation == "on top of" else _side_by_side)(rng, boxes)
    return [*_solids(*things[0], *first), *_solids(*things[1], *second)]


def _make(rng: np.random.Generator, thing: Thing, shapes: Shapes) -> tuple[Parts, Paints]:
    """The parts as (distance, paint), and (body, part, second colour, pattern)."""
    parts = shapes[thing.kind](rng)
    color = thing.color or list(words.COLORS)[rng.integers(len(words.COLORS))]
    body = _tint(rng, color)
    named = thing.part_color or words.PARTS.get(thing.kind, ("", None))[1]
    part = _tint(rng, named) if named else body * 0.62 + (0.12 if color == "black" else 0.0)
    second = _tint(rng, {"white": "gray", "gray": "black"}.get(color, "white"))
    return parts, (body, part, second, thing.pattern)


def _tint(rng: np.random.Generator, color: str) -> np.ndarray:
    """A colour's value, a little off."""
    return np.clip(np.asarray(words.COLORS[color]) + rng.normal(0, 0.025, 3), 0, 1).astype(np.float32)


def _solids(parts: Parts, paints: Paints, scale: float, centre: np.ndarray) -> list[Solid]:
    body, part, second, pattern = paints
    frame = (np.asarray(centre, np.float32), float(scale))
    placed = []
    for distance, paint in parts:
        color = {BODY: body, PART: part}.get(paint)
        color = np.asarray(words.COLORS[paint], np.float32) if color is None else color
        solid = at(scaled(distance, float(scale)), *map(float, centre))
        placed.append(Solid(solid, color, second, pattern if paint == BODY else None, frame))
    return placed


_AXIS = np.linspace(-1.15, 1.15, 24, dtype=np.float32)
_GRID = [axis.ravel() for axis in np.meshgrid(_AXIS, _AXIS, _AXIS, indexing="ij")]


def _bounds(distances: list[Distance]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner [3] of the box that holds them, on a coarse grid."""
    inside = np.minimum.reduce([distance(*_GRID) for distance in distances]) < 0.03
    points = np.stack([axis[inside] for axis in _GRID], -1)
    return points.min(0), points.max(0)


def _on_top(rng: np.random.Generator, boxes: Sequence[Box]) -> tuple[Stand, Stand]:
    """(scale, centre) of the upper and of the lower thing: it stands where the other ends, a little sunk in."""
    (upper_low, upper_high), (lower_low, lower_high) = boxes
    upper, lower = rng.uniform(0.48, 0.56), rng.uniform(0.58, 0.66)
    heights = upper * (upper_high - upper_low)[2], lower * (lower_high - lower_low)[2]
    floor = -(sum(heights) - 0.05) / 2
    shift = np.array([*rng.uniform(-0.08, 0.08, 2), 0])
    lower_centre = np.array([*(-lower * (lower_low + lower_high)[:2] / 2), floor - lower * lower_low[2]])
    upper_centre = np.array([*(-upper * (upper_low + upper_high)[:2] / 2), floor + heights[1] - 0.05 - upper * upper_low[2]])
    return (upper, upper_centre + shift), (lower, lower_centre)


def _side_by_side(rng: np.random.Generator, boxes: Sequence[Box]) -> tuple[Stand, Stand]:
    """(scale, centre) of both: on one floor, along a random direction, with a small gap."""
    scales = rng.uniform(0.52, 0.6, 2)
    angle = rng.uniform(0, 2 * np.pi)
    along = np.array([np.cos(angle), np.sin(angle)])
    reach = [scale * np.abs(along) @ np.maximum(-low, high)[:2] for scale, (low, high) in zip(scales, boxes, strict=True)]
    gap = rng.uniform(0.04, 0.16)
    half = 0.95 * sum(reach) + gap / 2
    floor = -max(scale * (high - low)[2] for scale, (low, high) in zip(scales, boxes, strict=True)) / 2
    places = (-half + reach[0], half - reach[1])
    first, second = (
        (float(scale), np.array([*(along * place), floor - scale * low[2]]))
        for scale, place, (low, _) in zip(scales, places, boxes, strict=True)
    )
    return first, second

"""Plain shapes, as signed distances."""

from __future__ import annotations

import numpy as np

from dreamfields_core.teaching.distances import at, box, cylinder, ellipsoid, frustum, planes, segment, star, torus, turned, within, without
from dreamfields_core.teaching.parts import BODY, Part, Parts, body, kind


@kind
def sphere(rng: np.random.Generator) -> Parts:
    """A ball."""
    return body(ellipsoid(0.9, 0.9, 0.9))


@kind
def cube(rng: np.random.Generator) -> Parts:
    """Slightly rounded."""
    return body(box(0.75, 0.75, 0.75, 0.05))


@kind
def cylinder_(rng: np.random.Generator) -> Parts:
    """Upright."""
    return body(cylinder(rng.uniform(0.48, 0.62), rng.uniform(0.75, 0.95)))


@kind
def cone(rng: np.random.Generator) -> Parts:
    """Upright."""
    return body(frustum(rng.uniform(0.65, 0.85), 0.0, 0.95))


@kind
def torus_(rng: np.random.Generator) -> Parts:
    """Lying, or standing on its rim."""
    ring = torus(0.7, rng.uniform(0.22, 0.3))
    return body(turned(ring, "x", np.pi / 2) if rng.random() < 0.4 else ring)


@kind
def capsule(rng: np.random.Generator) -> Parts:
    """Upright or lying."""
    radius, half = rng.uniform(0.28, 0.36), 0.65
    return body(segment((0, 0, -half), (0, 0, half), radius) if rng.random() < 0.6 else segment((-half, 0, 0), (half, 0, 0), radius))


@kind
def pyramid(rng: np.random.Generator) -> Parts:
    """Four sides."""
    slope = rng.uniform(0.5, 0.62)
    sides = [(1, 0, slope), (-1, 0, slope), (0, 1, slope), (0, -1, slope), (0, 0, -1)]
    return body(planes(sides, [slope * 0.8] * 4 + [0.75]))


@kind
def star_(rng: np.random.Generator) -> Parts:
    """Five tips, standing."""
    return body(star(1.05, rng.uniform(0.42, 0.5), rng.uniform(0.18, 0.26)))


@kind
def egg(rng: np.random.Generator) -> Parts:
    """Blunt end down."""
    radius = rng.uniform(0.6, 0.66)
    low, high = ellipsoid(radius, radius, 0.65), ellipsoid(radius, radius, rng.uniform(1.1, 1.2))
    return body(at(lambda x, y, z: np.where(z > 0, high(x, y, z), low(x, y, z)), z0=-0.25))


@kind
def arch(rng: np.random.Generator) -> Parts:
    """A half ring on two posts."""
    x, deep, thick = 0.9, rng.uniform(0.24, 0.34), rng.uniform(0.26, 0.34)
    top = without(turned(cylinder(x, deep), "x", np.pi / 2), turned(cylinder(x - thick, 2.0), "x", np.pi / 2))
    top = within(top, lambda px, py, pz: -pz)
    posts = [at(box(thick / 2, deep, 0.4), s * (x - thick / 2), 0, -0.4) for s in (-1, 1)]
    return [Part(at(solid, z0=-0.1), BODY) for solid in (top, *posts)]


@kind
def staircase(rng: np.random.Generator) -> Parts:
    """Four steps."""
    deep, rise = rng.uniform(0.45, 0.6), rng.uniform(0.36, 0.42)
    return body(*(at(box(0.22, deep, rise * (i + 1) / 2), -0.66 + 0.44 * i, 0, -0.8 + rise * (i + 1) / 2) for i in range(4)))


@kind
def cross(rng: np.random.Generator) -> Parts:
    """Upright, the bar above the middle."""
    thick, deep = rng.uniform(0.19, 0.25), rng.uniform(0.17, 0.25)
    return body(box(thick, deep, 1.0), at(box(rng.uniform(0.62, 0.72), deep, thick), z0=rng.uniform(0.25, 0.4)))

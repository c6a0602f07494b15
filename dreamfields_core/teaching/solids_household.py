"""Things of the house, as signed distances."""

from __future__ import annotations

import numpy as np

from dreamfields_core.teaching.distances import at, box, cylinder, ellipsoid, frustum, segment, torus, turned, union, within, without
from dreamfields_core.teaching.parts import Part, Parts, body, kind, part


@kind
def mug(rng: np.random.Generator) -> Parts:
    """A hollow cylinder with one large handle."""
    radius, half = rng.uniform(0.52, 0.6), rng.uniform(0.6, 0.72)
    wall = without(cylinder(radius, half), at(cylinder(radius - 0.1, half), z0=0.14))
    handle = without(turned(torus(0.38, 0.1), "x", np.pi / 2), at(cylinder(radius - 0.05, 2.0), x0=-radius))
    return body(wall) + part(at(handle, x0=radius))


@kind
def vase(rng: np.random.Generator) -> Parts:
    """A belly, a narrow neck, a flared rim."""
    belly, foot = rng.uniform(0.52, 0.62), rng.uniform(0.26, 0.34)
    form = union(
        at(ellipsoid(belly, belly, 0.55), z0=-0.3),
        at(cylinder(foot, 0.1), z0=-0.88),
        at(frustum(0.34, 0.2, 0.2), z0=0.3),
        at(frustum(0.2, rng.uniform(0.42, 0.5), 0.22), z0=0.7),
    )
    return body(without(form, at(frustum(0.12, 0.4, 0.22), z0=0.76)))


@kind
def table(rng: np.random.Generator) -> Parts:
    """A top on four legs."""
    x, y, leg = rng.uniform(0.85, 1.0), rng.uniform(0.6, 0.75), rng.uniform(0.08, 0.11)
    legs = [at(box(leg, leg, 0.52), sx * (x - 0.14), sy * (y - 0.14), -0.1) for sx in (-1, 1) for sy in (-1, 1)]
    return body(at(box(x, y, 0.1, 0.02), z0=0.5)) + part(*legs)


@kind
def chair(rng: np.random.Generator) -> Parts:
    """A seat, a tall back, four legs."""
    half, leg, tall = rng.uniform(0.46, 0.54), 0.08, rng.uniform(0.5, 0.6)
    legs = [at(box(leg, leg, 0.38), sx * (half - 0.08), sy * (half - 0.08), -0.6) for sx in (-1, 1) for sy in (-1, 1)]
    seat = at(box(half, half, 0.09, 0.02), z0=-0.18)
    back = at(box(0.09, half, tall, 0.02), x0=-half + 0.08, z0=-0.18 + tall)
    return body(seat, back) + part(*legs)


@kind
def lamp(rng: np.random.Generator) -> Parts:
    """A shade on a stand."""
    shade = at(frustum(rng.uniform(0.58, 0.68), rng.uniform(0.26, 0.36), 0.36), z0=0.55)
    return body(shade) + part(at(cylinder(0.07, 0.7), z0=-0.2), at(frustum(rng.uniform(0.38, 0.48), 0.3, 0.07), z0=-0.86))


@kind
def bottle(rng: np.random.Generator) -> Parts:
    """Shoulders, a long neck, a cap."""
    radius, neck = rng.uniform(0.34, 0.42), rng.uniform(0.11, 0.14)
    form = [at(cylinder(radius, 0.48), z0=-0.5), at(frustum(radius, neck, 0.16), z0=0.14), at(cylinder(neck, 0.3), z0=0.5)]
    return body(*form) + part(at(cylinder(neck + 0.06, 0.12), z0=0.86))


@kind
def hammer(rng: np.random.Generator) -> Parts:
    """A handle, upright, with a heavy head."""
    long, thick = rng.uniform(0.58, 0.66), rng.uniform(0.22, 0.27)
    head = at(box(long, thick, thick, 0.03), z0=0.62)
    claw = at(box(0.1, thick + 0.07, thick + 0.07, 0.02), x0=long - 0.08, z0=0.62)
    return body(head, claw) + part(at(box(0.11, 0.11, 0.8, 0.03), z0=-0.2))


@kind
def dumbbell(rng: np.random.Generator) -> Parts:
    """Two weights, discs or balls, on a bar."""
    wide, radius = rng.uniform(0.18, 0.24), rng.uniform(0.42, 0.5)
    round_ = rng.random() < 0.4
    weight = ellipsoid(radius * 0.9, radius * 0.9, radius * 0.9) if round_ else turned(cylinder(radius, wide), "y", np.pi / 2)
    return body(at(weight, x0=-0.72), at(weight, x0=0.72)) + part(segment((-0.7, 0, 0), (0.7, 0, 0), 0.12))


@kind
def candle(rng: np.random.Generator) -> Parts:
    """On a dish, with a flame."""
    radius = rng.uniform(0.24, 0.32)
    flame = union(at(ellipsoid(0.14, 0.14, 0.16), z0=0.58), at(frustum(0.13, 0.0, 0.18), z0=0.8))
    wick = Part(at(cylinder(0.035, 0.1), z0=0.4), "black")
    dish = at(frustum(0.36, 0.56, 0.08), z0=-0.86)
    return body(at(cylinder(radius, 0.62), z0=-0.24), dish) + part(flame) + [wick]


@kind
def bowl(rng: np.random.Generator) -> Parts:
    """Half a shell, open above."""
    radius, deep = 0.92, rng.uniform(0.72, 0.85)
    shell = without(ellipsoid(radius, radius, deep), at(ellipsoid(radius - 0.11, radius - 0.11, deep - 0.1), z0=0.02))
    return body(at(within(shell, lambda x, y, z: z), z0=0.35), at(cylinder(0.36, 0.07), z0=0.35 - deep))


@kind
def key(rng: np.random.Generator) -> Parts:
    """A ring, a shaft, two teeth."""
    ring = at(turned(torus(rng.uniform(0.28, 0.33), 0.1), "x", np.pi / 2), z0=0.6)
    teeth = [at(box(0.17, 0.08, 0.075), 0.22, 0, z) for z in (-0.85, -0.52)]
    return body(ring, at(box(0.09, 0.09, 0.66), z0=-0.32), *teeth)


@kind
def umbrella(rng: np.random.Generator) -> Parts:
    """An open canopy, a shaft, a hook."""
    radius = rng.uniform(0.88, 0.98)
    shell = without(ellipsoid(radius, radius, 0.62), at(ellipsoid(radius - 0.06, radius - 0.06, 0.56), z0=-0.03))
    canopy = at(within(shell, lambda x, y, z: -z), z0=0.25)
    hook = within(turned(torus(0.17, 0.06), "x", np.pi / 2), lambda x, y, z: z)
    return body(canopy) + part(segment((0, 0, 0.95), (0, 0, -0.7), 0.06), at(hook, 0.17, 0, -0.7))


@kind
def lollipop(rng: np.random.Generator) -> Parts:
    """A thick disc on a stick."""
    radius = rng.uniform(0.52, 0.6)
    return body(at(ellipsoid(radius, 0.24, radius), z0=0.45)) + part(at(cylinder(0.075, 0.6), z0=-0.45))


@kind
def ice_cream(rng: np.random.Generator) -> Parts:
    """One or two scoops in a cone."""
    scoop = rng.uniform(0.44, 0.5)
    balls = [at(ellipsoid(scoop, scoop, scoop), z0=0.3)]
    if rng.random() < 0.4:
        balls.append(at(ellipsoid(scoop * 0.75, scoop * 0.75, scoop * 0.75), z0=0.78))
    return body(*balls) + part(at(frustum(0.03, scoop * 0.9, 0.58), z0=-0.42))

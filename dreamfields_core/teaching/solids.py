"""The 36 kinds as signed distances, each with random proportions: iconic rather than true, so that 48 pixels suffice.

A kind is a function (rng) -> parts; a part is a distance and what colours it. They stand upright along Z, within about a unit of the origin.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dreamfields_core.teaching.distances import (
    Distance,
    at,
    box,
    cylinder,
    ellipsoid,
    frustum,
    planes,
    segment,
    star,
    torus,
    turned,
    union,
    within,
    without,
)

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


def _body(*solids: Distance) -> Parts:
    return [Part(solid, BODY) for solid in solids]


def _part(*solids: Distance) -> Parts:
    return [Part(solid, PART) for solid in solids]


@kind
def sphere(rng):
    return _body(ellipsoid(0.9, 0.9, 0.9))


@kind
def cube(rng):
    return _body(box(0.75, 0.75, 0.75, 0.05))


@kind
def cylinder_(rng):
    return _body(cylinder(rng.uniform(0.48, 0.62), rng.uniform(0.75, 0.95)))


@kind
def cone(rng):
    return _body(frustum(rng.uniform(0.65, 0.85), 0.0, 0.95))


@kind
def torus_(rng):
    ring = torus(0.7, rng.uniform(0.22, 0.3))
    return _body(turned(ring, "x", np.pi / 2) if rng.random() < 0.4 else ring)


@kind
def capsule(rng):
    radius, half = rng.uniform(0.28, 0.36), 0.65
    return _body(segment((0, 0, -half), (0, 0, half), radius) if rng.random() < 0.6 else segment((-half, 0, 0), (half, 0, 0), radius))


@kind
def pyramid(rng):
    slope = rng.uniform(0.5, 0.62)
    sides = [(1, 0, slope), (-1, 0, slope), (0, 1, slope), (0, -1, slope), (0, 0, -1)]
    return _body(planes(sides, [slope * 0.8] * 4 + [0.75]))


@kind
def star_(rng):
    return _body(star(1.05, rng.uniform(0.42, 0.5), rng.uniform(0.18, 0.26)))


@kind
def egg(rng):
    radius = rng.uniform(0.6, 0.66)
    low, high = ellipsoid(radius, radius, 0.65), ellipsoid(radius, radius, rng.uniform(1.1, 1.2))
    return _body(at(lambda x, y, z: np.where(z > 0, high(x, y, z), low(x, y, z)), z0=-0.25))


@kind
def mug(rng):
    radius, half = rng.uniform(0.52, 0.6), rng.uniform(0.6, 0.72)
    wall = without(cylinder(radius, half), at(cylinder(radius - 0.1, half), z0=0.14))
    handle = without(turned(torus(0.38, 0.1), "x", np.pi / 2), at(cylinder(radius - 0.05, 2.0), x0=-radius))
    return _body(wall) + _part(at(handle, x0=radius))


@kind
def vase(rng):
    belly, foot = rng.uniform(0.52, 0.62), rng.uniform(0.26, 0.34)
    body = union(
        at(ellipsoid(belly, belly, 0.55), z0=-0.3),
        at(cylinder(foot, 0.1), z0=-0.88),
        at(frustum(0.34, 0.2, 0.2), z0=0.3),
        at(frustum(0.2, rng.uniform(0.42, 0.5), 0.22), z0=0.7),
    )
    return _body(without(body, at(frustum(0.12, 0.4, 0.22), z0=0.76)))


@kind
def table(rng):
    x, y, leg = rng.uniform(0.85, 1.0), rng.uniform(0.6, 0.75), rng.uniform(0.08, 0.11)
    legs = [at(box(leg, leg, 0.52), sx * (x - 0.14), sy * (y - 0.14), -0.1) for sx in (-1, 1) for sy in (-1, 1)]
    return _body(at(box(x, y, 0.1, 0.02), z0=0.5)) + _part(*legs)


@kind
def chair(rng):
    half, leg, tall = rng.uniform(0.46, 0.54), 0.08, rng.uniform(0.5, 0.6)
    legs = [at(box(leg, leg, 0.38), sx * (half - 0.08), sy * (half - 0.08), -0.6) for sx in (-1, 1) for sy in (-1, 1)]
    seat = at(box(half, half, 0.09, 0.02), z0=-0.18)
    back = at(box(0.09, half, tall, 0.02), x0=-half + 0.08, z0=-0.18 + tall)
    return _body(seat, back) + _part(*legs)


@kind
def mushroom(rng):
    cap = rng.uniform(0.75, 0.9)
    dome = within(at(ellipsoid(cap, cap, rng.uniform(0.62, 0.75)), z0=0.05), lambda x, y, z: -z)
    return _body(at(dome, z0=0.1)) + _part(at(frustum(rng.uniform(0.28, 0.36), 0.22, 0.45), z0=-0.35))


@kind
def snowman(rng):
    low, middle, head = 0.52, rng.uniform(0.36, 0.4), rng.uniform(0.25, 0.29)
    z1 = -0.48 + low * 0.8 + middle * 0.75
    z2 = z1 + middle * 0.8 + head * 0.75
    balls = [at(ellipsoid(r, r, r), z0=z) for r, z in ((low, -0.48), (middle, z1), (head, z2))]
    hat = [at(cylinder(head * 1.15, 0.035), z0=z2 + head * 0.72), at(cylinder(head * 0.72, 0.16), z0=z2 + head * 0.72 + 0.18)]
    nose = at(turned(frustum(0.09, 0.0, 0.17), "y", np.pi / 2), head + 0.1, 0, z2)
    return _body(*balls) + _part(*hat) + [Part(nose, "orange")]


@kind
def tree(rng):
    crown = rng.uniform(0.5, 0.58)
    leaves = [at(ellipsoid(crown, crown, crown), z0=0.4)]
    turn = rng.uniform(0, 2 * np.pi)
    for angle in (turn, turn + 2.1, turn + 4.2):
        leaves.append(at(ellipsoid(0.36, 0.36, 0.36), 0.38 * np.cos(angle), 0.38 * np.sin(angle), 0.22))
    return _body(*leaves) + _part(at(frustum(rng.uniform(0.16, 0.22), 0.12, 0.48), z0=-0.5))


@kind
def pine(rng):
    wide = rng.uniform(0.62, 0.72)
    tiers = [at(frustum(wide * s, 0.06, 0.3), z0=z) for s, z in ((1.0, -0.3), (0.8, 0.14), (0.6, 0.58))]
    return _body(*tiers, at(frustum(0.2, 0.0, 0.14), z0=0.92)) + _part(at(cylinder(rng.uniform(0.13, 0.18), 0.22), z0=-0.8))


@kind
def house(rng):
    x, y, wall, rise = rng.uniform(0.6, 0.72), rng.uniform(0.6, 0.75), 0.42, rng.uniform(0.5, 0.62)
    eaves = x + 0.14
    roof = within(planes([(rise, 0, eaves), (-rise, 0, eaves), (0, 0, -1)], [rise * eaves, rise * eaves, 0.0]), box(2.0, y + 0.1, 2.0))
    door = at(box(0.14, 0.03, 0.26), y0=-y, z0=-0.5)
    return _body(at(box(x, y, wall), z0=-0.34)) + _part(at(roof, z0=0.08)) + [Part(door, "brown")]


@kind
def rocket(rng):
    radius = rng.uniform(0.26, 0.32)
    hull = at(cylinder(radius, 0.5), z0=-0.15)
    nose = within(at(ellipsoid(radius, radius, 0.68), z0=0.35), lambda x, y, z: 0.35 - z)
    blade = within(planes([(1, 0, 0.75), (0, 0, -1), (-1, 0, 0)], [0.36, 0.98, 0.0]), box(2.0, 0.05, 2.0))
    turn = rng.uniform(0, 2)
    fins = [turned(blade, "z", turn + i * 2 * np.pi / 4) for i in range(4)]
    return _body(hull, nose) + _part(*fins)


@kind
def lamp(rng):
    shade = at(frustum(rng.uniform(0.58, 0.68), rng.uniform(0.26, 0.36), 0.36), z0=0.55)
    return _body(shade) + _part(at(cylinder(0.07, 0.7), z0=-0.2), at(frustum(rng.uniform(0.38, 0.48), 0.3, 0.07), z0=-0.86))


@kind
def bottle(rng):
    radius, neck = rng.uniform(0.34, 0.42), rng.uniform(0.11, 0.14)
    body = [at(cylinder(radius, 0.48), z0=-0.5), at(frustum(radius, neck, 0.16), z0=0.14), at(cylinder(neck, 0.3), z0=0.5)]
    return _body(*body) + _part(at(cylinder(neck + 0.06, 0.12), z0=0.86))


@kind
def hammer(rng):
    long, thick = rng.uniform(0.58, 0.66), rng.uniform(0.22, 0.27)
    head = at(box(long, thick, thick, 0.03), z0=0.62)
    claw = at(box(0.1, thick + 0.07, thick + 0.07, 0.02), x0=long - 0.08, z0=0.62)
    return _body(head, claw) + _part(at(box(0.11, 0.11, 0.8, 0.03), z0=-0.2))


@kind
def dumbbell(rng):
    wide, radius = rng.uniform(0.18, 0.24), rng.uniform(0.42, 0.5)
    round_ = rng.random() < 0.4
    weight = ellipsoid(radius * 0.9, radius * 0.9, radius * 0.9) if round_ else turned(cylinder(radius, wide), "y", np.pi / 2)
    return _body(at(weight, x0=-0.72), at(weight, x0=0.72)) + _part(segment((-0.7, 0, 0), (0.7, 0, 0), 0.12))


@kind
def arch(rng):
    x, deep, thick = 0.9, rng.uniform(0.24, 0.34), rng.uniform(0.26, 0.34)
    top = without(turned(cylinder(x, deep), "x", np.pi / 2), turned(cylinder(x - thick, 2.0), "x", np.pi / 2))
    top = within(top, lambda px, py, pz: -pz)
    posts = [at(box(thick / 2, deep, 0.4), s * (x - thick / 2), 0, -0.4) for s in (-1, 1)]
    return [Part(at(solid, z0=-0.1), BODY) for solid in (top, *posts)]


@kind
def staircase(rng):
    deep, rise = rng.uniform(0.45, 0.6), rng.uniform(0.36, 0.42)
    return _body(*(at(box(0.22, deep, rise * (i + 1) / 2), -0.66 + 0.44 * i, 0, -0.8 + rise * (i + 1) / 2) for i in range(4)))


@kind
def cross(rng):
    thick, deep = rng.uniform(0.19, 0.25), rng.uniform(0.17, 0.25)
    return _body(box(thick, deep, 1.0), at(box(rng.uniform(0.62, 0.72), deep, thick), z0=rng.uniform(0.25, 0.4)))


@kind
def car(rng):
    y, low = rng.uniform(0.42, 0.48), rng.uniform(0.2, 0.25)
    hull = at(box(1.0, y, low, 0.08), z0=-0.12)
    cabin = at(box(rng.uniform(0.48, 0.56), y - 0.06, 0.24, 0.08), x0=-0.12, z0=0.26)
    panes = at(union(box(0.58, y - 0.12, 0.12), box(0.38, y - 0.03, 0.12)), x0=-0.12, z0=0.28)
    wheel = turned(cylinder(0.27, 0.12), "x", np.pi / 2)
    wheels = [at(wheel, sx * 0.58, sy * (y - 0.02), -0.34) for sx in (-1, 1) for sy in (-1, 1)]
    return _body(hull, cabin) + _part(*wheels) + [Part(panes, "gray")]


@kind
def lollipop(rng):
    radius = rng.uniform(0.52, 0.6)
    return _body(at(ellipsoid(radius, 0.24, radius), z0=0.45)) + _part(at(cylinder(0.075, 0.6), z0=-0.45))


@kind
def ice_cream(rng):
    scoop = rng.uniform(0.44, 0.5)
    balls = [at(ellipsoid(scoop, scoop, scoop), z0=0.3)]
    if rng.random() < 0.4:
        balls.append(at(ellipsoid(scoop * 0.75, scoop * 0.75, scoop * 0.75), z0=0.78))
    return _body(*balls) + _part(at(frustum(0.03, scoop * 0.9, 0.58), z0=-0.42))


@kind
def flower(rng):
    petals, tilt, long = int(rng.integers(5, 8)), rng.uniform(0.3, 1.0), 0.3
    bloom = []
    for i in range(petals):
        angle = 2 * np.pi * i / petals
        bloom.append(turned(at(ellipsoid(long, 0.2 * 6 / petals + 0.02, 0.09), x0=0.4), "z", angle))
    place = lambda solid: at(turned(solid, "x", tilt), z0=0.45)
    leaf = at(turned(ellipsoid(0.28, 0.11, 0.06), "y", -0.5), 0.24, 0, -0.45)
    stem = segment((0, 0, 0.4), (0, 0, -1.0), 0.065)
    heart = place(at(ellipsoid(0.22, 0.22, 0.14), z0=0.03))
    return [Part(place(petal), BODY) for petal in bloom] + _part(stem, leaf) + [Part(heart, "yellow")]


@kind
def umbrella(rng):
    radius = rng.uniform(0.88, 0.98)
    shell = without(ellipsoid(radius, radius, 0.62), at(ellipsoid(radius - 0.06, radius - 0.06, 0.56), z0=-0.03))
    canopy = at(within(shell, lambda x, y, z: -z), z0=0.25)
    hook = within(turned(torus(0.17, 0.06), "x", np.pi / 2), lambda x, y, z: z)
    return _body(canopy) + _part(segment((0, 0, 0.95), (0, 0, -0.7), 0.06), at(hook, 0.17, 0, -0.7))


@kind
def boat(rng):
    hull = within(at(ellipsoid(1.0, 0.42, 0.55), z0=-0.35), lambda x, y, z: z + 0.35)
    mast = at(cylinder(0.05, 0.72), z0=0.3)
    side = rng.uniform(0.58, 0.68)
    sail = within(planes([(1, 0, side), (-1, 0, 0), (0, 0, -1)], [side * 0.98, -0.06, 0.15]), box(2.0, 0.05, 2.0))
    jib = within(planes([(-1, 0, 0.5), (1, 0, 0), (0, 0, -1)], [0.4, -0.08, 0.15]), box(2.0, 0.05, 2.0))
    return _body(hull) + _part(sail, jib) + [Part(mast, "brown")]


@kind
def airplane(rng):
    chord, span = rng.uniform(0.2, 0.26), rng.uniform(0.92, 1.02)
    fuselage = ellipsoid(1.0, 0.2, 0.2)
    wing = at(box(chord, span, 0.055, 0.02), x0=0.1)
    tail = [at(box(0.13, 0.38, 0.045, 0.02), x0=-0.84, z0=0.04), at(box(0.15, 0.045, 0.24, 0.02), x0=-0.84, z0=0.22)]
    return _body(fuselage) + _part(wing, *tail)


@kind
def candle(rng):
    radius = rng.uniform(0.24, 0.32)
    flame = union(at(ellipsoid(0.14, 0.14, 0.16), z0=0.58), at(frustum(0.13, 0.0, 0.18), z0=0.8))
    wick = Part(at(cylinder(0.035, 0.1), z0=0.4), "black")
    dish = at(frustum(0.36, 0.56, 0.08), z0=-0.86)
    return _body(at(cylinder(radius, 0.62), z0=-0.24), dish) + _part(flame) + [wick]


@kind
def bowl(rng):
    radius, deep = 0.92, rng.uniform(0.72, 0.85)
    shell = without(ellipsoid(radius, radius, deep), at(ellipsoid(radius - 0.11, radius - 0.11, deep - 0.1), z0=0.02))
    return _body(at(within(shell, lambda x, y, z: z), z0=0.35), at(cylinder(0.36, 0.07), z0=0.35 - deep))


@kind
def key(rng):
    ring = at(turned(torus(rng.uniform(0.28, 0.33), 0.1), "x", np.pi / 2), z0=0.6)
    teeth = [at(box(0.17, 0.08, 0.075), 0.22, 0, z) for z in (-0.85, -0.52)]
    return _body(ring, at(box(0.09, 0.09, 0.66), z0=-0.32), *teeth)

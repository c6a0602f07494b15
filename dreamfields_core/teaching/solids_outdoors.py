"""Things out of doors, as signed distances."""

from __future__ import annotations

import numpy as np

from dreamfields_core.teaching.distances import Distance, at, box, cylinder, ellipsoid, frustum, planes, segment, turned, union, within
from dreamfields_core.teaching.parts import BODY, Part, Parts, body, kind, part


@kind
def mushroom(rng: np.random.Generator) -> Parts:
    """Half a ball on a stem."""
    cap = rng.uniform(0.75, 0.9)
    dome = within(at(ellipsoid(cap, cap, rng.uniform(0.62, 0.75)), z0=0.05), lambda x, y, z: -z)
    return body(at(dome, z0=0.1)) + part(at(frustum(rng.uniform(0.28, 0.36), 0.22, 0.45), z0=-0.35))


@kind
def snowman(rng: np.random.Generator) -> Parts:
    """Three balls, a hat, a nose."""
    low, middle, head = 0.52, rng.uniform(0.36, 0.4), rng.uniform(0.25, 0.29)
    z1 = -0.48 + low * 0.8 + middle * 0.75
    z2 = z1 + middle * 0.8 + head * 0.75
    balls = [at(ellipsoid(r, r, r), z0=z) for r, z in ((low, -0.48), (middle, z1), (head, z2))]
    hat = [at(cylinder(head * 1.15, 0.035), z0=z2 + head * 0.72), at(cylinder(head * 0.72, 0.16), z0=z2 + head * 0.72 + 0.18)]
    nose = at(turned(frustum(0.09, 0.0, 0.17), "y", np.pi / 2), head + 0.1, 0, z2)
    return body(*balls) + part(*hat) + [Part(nose, "orange")]


@kind
def tree(rng: np.random.Generator) -> Parts:
    """Four balls of leaves on a trunk."""
    crown = rng.uniform(0.5, 0.58)
    leaves = [at(ellipsoid(crown, crown, crown), z0=0.4)]
    turn = rng.uniform(0, 2 * np.pi)
    for angle in (turn, turn + 2.1, turn + 4.2):
        leaves.append(at(ellipsoid(0.36, 0.36, 0.36), 0.38 * np.cos(angle), 0.38 * np.sin(angle), 0.22))
    return body(*leaves) + part(at(frustum(rng.uniform(0.16, 0.22), 0.12, 0.48), z0=-0.5))


@kind
def pine(rng: np.random.Generator) -> Parts:
    """Three tiers and a tip on a trunk."""
    wide = rng.uniform(0.62, 0.72)
    tiers = [at(frustum(wide * s, 0.06, 0.3), z0=z) for s, z in ((1.0, -0.3), (0.8, 0.14), (0.6, 0.58))]
    return body(*tiers, at(frustum(0.2, 0.0, 0.14), z0=0.92)) + part(at(cylinder(rng.uniform(0.13, 0.18), 0.22), z0=-0.8))


@kind
def house(rng: np.random.Generator) -> Parts:
    """Walls, a gabled roof with eaves, a door."""
    x, y, wall, rise = rng.uniform(0.6, 0.72), rng.uniform(0.6, 0.75), 0.42, rng.uniform(0.5, 0.62)
    eaves = x + 0.14
    roof = within(planes([(rise, 0, eaves), (-rise, 0, eaves), (0, 0, -1)], [rise * eaves, rise * eaves, 0.0]), box(2.0, y + 0.1, 2.0))
    door = at(box(0.14, 0.03, 0.26), y0=-y, z0=-0.5)
    return body(at(box(x, y, wall), z0=-0.34)) + part(at(roof, z0=0.08)) + [Part(door, "brown")]


@kind
def rocket(rng: np.random.Generator) -> Parts:
    """A pointed hull with four fins."""
    radius = rng.uniform(0.26, 0.32)
    hull = at(cylinder(radius, 0.5), z0=-0.15)
    nose = within(at(ellipsoid(radius, radius, 0.68), z0=0.35), lambda x, y, z: 0.35 - z)
    blade = within(planes([(1, 0, 0.75), (0, 0, -1), (-1, 0, 0)], [0.36, 0.98, 0.0]), box(2.0, 0.05, 2.0))
    turn = rng.uniform(0, 2)
    fins = [turned(blade, "z", turn + i * 2 * np.pi / 4) for i in range(4)]
    return body(hull, nose) + part(*fins)


@kind
def car(rng: np.random.Generator) -> Parts:
    """A hull, a cabin with panes, four wheels."""
    y, low = rng.uniform(0.42, 0.48), rng.uniform(0.2, 0.25)
    hull = at(box(1.0, y, low, 0.08), z0=-0.12)
    cabin = at(box(rng.uniform(0.48, 0.56), y - 0.06, 0.24, 0.08), x0=-0.12, z0=0.26)
    panes = at(union(box(0.58, y - 0.12, 0.12), box(0.38, y - 0.03, 0.12)), x0=-0.12, z0=0.28)
    wheel = turned(cylinder(0.27, 0.12), "x", np.pi / 2)
    wheels = [at(wheel, sx * 0.58, sy * (y - 0.02), -0.34) for sx in (-1, 1) for sy in (-1, 1)]
    return body(hull, cabin) + part(*wheels) + [Part(panes, "gray")]


@kind
def flower(rng: np.random.Generator) -> Parts:
    """Petals about a heart, tilted, on a stem with a leaf."""
    petals, tilt, long = int(rng.integers(5, 8)), rng.uniform(0.3, 1.0), 0.3
    bloom = []
    for i in range(petals):
        angle = 2 * np.pi * i / petals
        bloom.append(turned(at(ellipsoid(long, 0.2 * 6 / petals + 0.02, 0.09), x0=0.4), "z", angle))

    def place(solid: Distance) -> Distance:
        return at(turned(solid, "x", tilt), z0=0.45)

    leaf = at(turned(ellipsoid(0.28, 0.11, 0.06), "y", -0.5), 0.24, 0, -0.45)
    stem = segment((0, 0, 0.4), (0, 0, -1.0), 0.065)
    heart = place(at(ellipsoid(0.22, 0.22, 0.14), z0=0.03))
    return [Part(place(petal), BODY) for petal in bloom] + part(stem, leaf) + [Part(heart, "yellow")]


@kind
def boat(rng: np.random.Generator) -> Parts:
    """A hull, a mast, two sails."""
    hull = within(at(ellipsoid(1.0, 0.42, 0.55), z0=-0.35), lambda x, y, z: z + 0.35)
    mast = at(cylinder(0.05, 0.72), z0=0.3)
    side = rng.uniform(0.58, 0.68)
    sail = within(planes([(1, 0, side), (-1, 0, 0), (0, 0, -1)], [side * 0.98, -0.06, 0.15]), box(2.0, 0.05, 2.0))
    jib = within(planes([(-1, 0, 0.5), (1, 0, 0), (0, 0, -1)], [0.4, -0.08, 0.15]), box(2.0, 0.05, 2.0))
    return body(hull) + part(sail, jib) + [Part(mast, "brown")]


@kind
def airplane(rng: np.random.Generator) -> Parts:
    """A hull, wings, a tail."""
    chord, span = rng.uniform(0.2, 0.26), rng.uniform(0.92, 1.02)
    fuselage = ellipsoid(1.0, 0.2, 0.2)
    wing = at(box(chord, span, 0.055, 0.02), x0=0.1)
    tail = [at(box(0.13, 0.38, 0.045, 0.02), x0=-0.84, z0=0.04), at(box(0.15, 0.045, 0.24, 0.02), x0=-0.84, z0=0.22)]
    return body(fuselage) + part(wing, *tail)

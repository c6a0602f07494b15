"""Signed distances of simple solids: negative inside, and outside no larger than the true distance, or hardly.

A `Distance` maps coordinates x, y, z, each [N], to distances [N]; Z is up. After Quilez, "distance functions" (iquilezles.org).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

Distance = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def ellipsoid(rx: float, ry: float, rz: float) -> Distance:
    """Half-axes; the exact sphere where they agree, else a bound of first order."""
    if rx == ry == rz:
        return lambda x, y, z: np.sqrt(x * x + y * y + z * z) - rx

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        x, y, z = x / rx, y / ry, z / rz
        k0 = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / rx, y / ry, z / rz
        k1 = np.sqrt(x * x + y * y + z * z) + 1e-6
        return np.maximum(k0 * (k0 - 1) / k1, (k0 - 1) * min(rx, ry, rz))

    return distance


def box(hx: float, hy: float, hz: float, rounding: float = 0.0) -> Distance:
    """Half-sides, rounding included."""

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        x, y, z = np.abs(x) - (hx - rounding), np.abs(y) - (hy - rounding), np.abs(z) - (hz - rounding)
        inside = np.minimum(np.maximum(x, np.maximum(y, z)), 0)
        x, y, z = np.maximum(x, 0), np.maximum(y, 0), np.maximum(z, 0)
        return np.sqrt(x * x + y * y + z * z) + inside - rounding

    return distance


def cylinder(radius: float, half: float) -> Distance:
    """About Z, from -half to half."""

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        r, z = np.sqrt(x * x + y * y) - radius, np.abs(z) - half
        inside = np.minimum(np.maximum(r, z), 0)
        r, z = np.maximum(r, 0), np.maximum(z, 0)
        return np.sqrt(r * r + z * z) + inside

    return distance


def frustum(bottom: float, top: float, half: float) -> Distance:
    """About Z: radius `bottom` at -half and `top` at half; a cone where one of them is 0. A bound: the largest of its planes."""
    slope = (bottom - top) / (2 * half)
    norm = 1 / np.sqrt(1 + slope * slope)
    middle = (bottom + top) / 2
    return lambda x, y, z: np.maximum((np.sqrt(x * x + y * y) - middle + slope * z) * norm, np.abs(z) - half)


def torus(radius: float, thickness: float) -> Distance:
    """Ring of `radius` about Z, a tube of `thickness`."""

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        ring = np.sqrt(x * x + y * y) - radius
        return np.sqrt(ring * ring + z * z) - thickness

    return distance


def segment(a: Sequence[float], b: Sequence[float], radius: float) -> Distance:
    """Capsule from `a` to `b`."""
    ax, ay, az = a
    dx, dy, dz = (q - p for p, q in zip(a, b, strict=True))
    square = dx * dx + dy * dy + dz * dz

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        x, y, z = x - ax, y - ay, z - az
        t = np.clip((x * dx + y * dy + z * dz) / square, 0, 1)
        x, y, z = x - t * dx, y - t * dy, z - t * dz
        return np.sqrt(x * x + y * y + z * z) - radius

    return distance


def planes(normals: Sequence[Sequence[float]], offsets: Sequence[float]) -> Distance:
    """Convex solid: inside all half-spaces n . p <= offset; normals need not be of unit length."""
    table = []
    for normal, offset in zip(normals, offsets, strict=True):
        length = float(np.linalg.norm(normal))
        table.append((*(float(n) / length for n in normal), offset / length))

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.maximum.reduce([nx * x + ny * y + nz * z - offset for nx, ny, nz, offset in table])

    return distance


def star(outer: float, inner: float, half: float) -> Distance:
    """Five-pointed star in the plane of X and Z, a tip upwards, extruded along Y."""
    sector = np.pi / 5
    ix, iz = inner * np.sin(sector), inner * np.cos(sector)
    nx, nz = outer - iz, ix
    length = np.hypot(nx, nz)
    nx, nz = nx / length, nz / length

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        angle = np.arctan2(x, z)
        angle = np.abs(angle - 2 * sector * np.round(angle / (2 * sector)))
        r = np.sqrt(x * x + z * z)
        edge = nx * r * np.sin(angle) + nz * (r * np.cos(angle) - outer)
        return np.maximum(edge, np.abs(y) - half)

    return distance


def at(solid: Distance, x0: float = 0.0, y0: float = 0.0, z0: float = 0.0) -> Distance:
    """Moved by (x0, y0, z0)."""
    return lambda x, y, z: solid(x - x0, y - y0, z - z0)


def turned(solid: Distance, axis: str, angle: float) -> Distance:
    """Turned about an axis through the origin, in radians."""
    c, s = float(np.cos(angle)), float(np.sin(angle))
    if axis == "x":
        return lambda x, y, z: solid(x, c * y + s * z, c * z - s * y)
    if axis == "y":
        return lambda x, y, z: solid(c * x - s * z, y, c * z + s * x)
    return lambda x, y, z: solid(c * x + s * y, c * y - s * x, z)


def scaled(solid: Distance, scale: float) -> Distance:
    """Larger by `scale` about the origin."""
    return lambda x, y, z: solid(x / scale, y / scale, z / scale) * scale


def union(*solids: Distance) -> Distance:
    """Inside any of them."""
    return lambda x, y, z: np.minimum.reduce([solid(x, y, z) for solid in solids])


def without(solid: Distance, *cuts: Distance) -> Distance:
    """Inside `solid` and outside every cut."""
    return lambda x, y, z: np.maximum.reduce([solid(x, y, z), *(-cut(x, y, z) for cut in cuts)])


def within(*solids: Distance) -> Distance:
    """Inside all of them."""
    return lambda x, y, z: np.maximum.reduce([solid(x, y, z) for solid in solids])

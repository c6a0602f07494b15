"""Pictures of a described scene: sphere tracing with cones first (Hart 1996), patterns, light, and coverage by supersampling.

Images are RGBA uint8 [size, size, 4], row 0 at the top, colour premultiplied by alpha.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dreamfields_core.teaching.language import Description
from dreamfields_core.teaching.solids import KINDS
from dreamfields_core.teaching.staging import Shapes, Solid, stage

SIZE = 48
SUPERSAMPLING = 2
Axes = Sequence[np.ndarray]
"""x, y and z of many points or directions, [N] each."""
BLOCK = 4
"""Side, in supersampled pixels, of the block that one cone traces first."""


class Camera(NamedTuple):
    """Looks at `target` from radius (cos el cos az, cos el sin az, sin el); angles in radians, focal in picture widths."""

    azimuth: float
    elevation: float
    radius: float = 4.0
    focal: float = 1.2
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Light(NamedTuple):
    """strength: how far shadow darkens, in [0, 1] (0: flat colour). direction: [3] unit, towards the light; None: at the eye."""

    strength: float
    direction: np.ndarray | None = None


def random_camera(
    rng: np.random.Generator, *, elevations: tuple[float, float] = (0.0, 60.0), gap: tuple[float, float] | None = None, sized: bool = False
) -> Camera:
    """Any azimuth, an elevation of the range in degrees outside `gap`; the focal length varies little where sizes must be told."""
    while True:
        elevation = rng.uniform(*elevations)
        if gap is None or not gap[0] < elevation < gap[1]:
            break
    focal = rng.uniform(1.15, 1.3) if sized else rng.uniform(1.05, 1.6)
    x, y, z = rng.uniform(-0.12, 0.12, 3).tolist()
    return Camera(rng.uniform(0, 2 * np.pi), np.deg2rad(elevation), rng.uniform(3.6, 4.4), focal, (x, y, z))


def random_light(rng: np.random.Generator) -> Light:
    """Flat, at the eye, or from somewhere above: a third each."""
    form = rng.integers(3)
    if form == 0:
        return Light(rng.uniform(0, 0.15))
    if form == 1:
        return Light(rng.uniform(0.3, 0.7))
    direction = np.array([*rng.normal(size=2), rng.uniform(0.3, 2.0)])
    return Light(rng.uniform(0.3, 0.6), (direction / np.linalg.norm(direction)).astype(np.float32))


def render_description(
    description: Description, cameras: list[Camera], *, seed: int = 0, size: int = SIZE, light: Light | None = None, shapes: Shapes = KINDS
) -> np.ndarray:
    """True pictures of one scene from several cameras, RGBA uint8 [views, size, size, 4]: the oracle, and multi-view ground truth.

    `seed` decides the proportions; the scene is the same in all views. shapes: `control.BLOBS` for what has the colours alone.
    """
    solids = stage(np.random.default_rng(seed), description, shapes=shapes)
    return np.stack([render(solids, camera, light or Light(0.4), size=size) for camera in cameras])


def render(solids: list[Solid], camera: Camera, light: Light, *, size: int = SIZE) -> np.ndarray:
    """One picture, RGBA uint8 [size, size, 4], premultiplied."""
    wide = size * SUPERSAMPLING
    eye, axes = _pose(camera)
    near, far = float(np.linalg.norm(eye)) - 2.4, float(np.linalg.norm(eye)) + 2.4
    coarse = _directions(wide, camera.focal, axes, block=BLOCK)
    cone = 0.75 * BLOCK / (wide * camera.focal)
    start = _march_cones(solids, eye, coarse, cone, near, far)
    blocks = start.reshape(-(-wide // BLOCK), -1)
    start = np.repeat(np.repeat(blocks, BLOCK, 0), BLOCK, 1)[:wide, :wide].ravel()
    alive = np.flatnonzero(np.isfinite(start))
    directions = [axis[alive] for axis in _directions(wide, camera.focal, axes)]
    depth = _march(solids, eye, directions, start[alive], far, 0.5 / (wide * camera.focal))
    hit = np.isfinite(depth)
    image = np.zeros((wide * wide, 4), np.float32)
    if hit.any():
        points = [e + depth[hit] * d[hit] for e, d in zip(eye, directions, strict=True)]
        image[alive[hit], :3] = _colors(solids, points, eye, light)
        image[alive[hit], 3] = 1
    image = image.reshape(size, SUPERSAMPLING, size, SUPERSAMPLING, 4).mean((1, 3))
    return (image * 255 + 0.5).astype(np.uint8)


def _pose(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Eye [3] and rows right, down, forward [3, 3]."""
    ce, se, ca, sa = np.cos(camera.elevation), np.sin(camera.elevation), np.cos(camera.azimuth), np.sin(camera.azimuth)
    back = np.array([ce * ca, ce * sa, se])
    right = np.array([-sa, ca, 0.0])
    axes = np.stack([right, -np.cross(back, right), -back])
    return (camera.radius * back + camera.target).astype(np.float32), axes.astype(np.float32)


def _directions(wide: int, focal: float, axes: np.ndarray, *, block: int = 1) -> list[np.ndarray]:
    """Unit directions through the centres of blocks of pixels, row by row: three arrays [n * n], n blocks cover `wide` pixels."""
    offset = block * (np.arange(-(-wide // block), dtype=np.float32) + 0.5) / wide - 0.5
    offset /= np.float32(focal)
    u, v = np.tile(offset, len(offset)), np.repeat(offset, len(offset))
    norm = 1 / np.sqrt(1 + u * u + v * v)
    return [(u * right + v * down + forward) * norm for right, down, forward in axes.T]


def _distance(solids: list[Solid], eye: np.ndarray, directions: Axes, t: np.ndarray) -> np.ndarray:
    x, y, z = (e + t * d for e, d in zip(eye, directions, strict=True))
    distance = solids[0].distance(x, y, z)
    for solid in solids[1:]:
        distance = np.minimum(distance, solid.distance(x, y, z))
    return distance


def _march_cones(
    solids: list[Solid], eye: np.ndarray, directions: Axes, cone: float, near: float, far: float, steps: int = 16
) -> np.ndarray:
    """How far each cone of radius `cone` * t surely meets nothing; infinite where it meets nothing at all."""
    t = np.full(len(directions[0]), near, np.float32)
    active = np.arange(len(t))
    for _ in range(steps):
        here = t[active]
        free = _distance(solids, eye, [d[active] for d in directions], here) - cone * here
        t[active] = here + np.maximum(free, 0)
        active = active[(free > 0.5 * cone * here) & (t[active] < far)]
        if not len(active):
            break
    return np.where(t < far, t, np.inf).astype(np.float32)


def _march(
    solids: list[Solid], eye: np.ndarray, directions: Axes, t: np.ndarray, far: float, precision: float, steps: int = 16
) -> np.ndarray:
    """Depth of the first surface along each ray, infinite where there is none; grazing rays count as hits where they end close."""
    t, active = t.copy(), np.arange(len(t))
    near = directions
    distance = np.zeros(0)
    for _ in range(steps):
        distance = _distance(solids, eye, near, t[active])
        t[active] += distance
        keep = (np.abs(distance) > precision * t[active]) & (t[active] < far)
        active, distance, near = active[keep], distance[keep], [d[keep] for d in near]
        if not len(active):
            break
    t[active[distance > 8 * precision * t[active]]] = np.inf
    return np.where(t < far, t, np.inf)


def _colors(solids: list[Solid], points: Axes, eye: np.ndarray, light: Light) -> np.ndarray:
    """Shaded colours [N, 3] of surface points."""
    distances = np.stack([solid.distance(*points) for solid in solids])
    which = distances.argmin(0)
    colors = np.stack([solid.color for solid in solids])[which]
    normals = _normals(solids, points)
    for solid_index, solid in enumerate(solids):
        if solid.pattern is not None:
            mine = np.flatnonzero(which == solid_index)
            second = _pattern(solid, [axis[mine] for axis in points], [axis[mine] for axis in normals])
            colors[mine[second]] = solid.second
    if light.direction is None:
        toward = [e - p for e, p in zip(eye, points, strict=True)]
        length = np.sqrt(sum(a * a for a in toward))
        lambert = sum(n * a for n, a in zip(normals, toward, strict=True)) / length
    else:
        lambert = 0.5 + 0.5 * sum(n * a for n, a in zip(normals, light.direction, strict=True))
    return colors * (1 - light.strength * (1 - np.clip(lambert, 0, 1)))[:, None]


def _normals(solids: list[Solid], points: Axes, step: float = 0.004) -> list[np.ndarray]:
    """Gradient of the distance from the four corners of a tetrahedron, of unit length."""
    gradient = [np.zeros_like(points[0]) for _ in range(3)]
    for signs in ((1, -1, -1), (-1, -1, 1), (-1, 1, -1), (1, 1, 1)):
        moved = [axis + np.float32(step * sign) for axis, sign in zip(points, signs, strict=True)]
        distance = np.minimum.reduce([solid.distance(*moved) for solid in solids])
        for axis, sign in enumerate(signs):
            gradient[axis] += sign * distance
    norm = 1 / np.sqrt(sum(g * g for g in gradient) + 1e-12)
    return [g * norm for g in gradient]


def _pattern(solid: Solid, points: Axes, normals: Axes) -> np.ndarray:
    """Where the second colour shows: stripes, squares or dots on the plane that the surface faces most."""
    centre, scale = solid.frame
    x, y, z = ((axis - c) / np.float32(scale) for axis, c in zip(points, centre, strict=True))
    nx, ny, nz = (np.abs(n) for n in normals)
    facing_up, facing_x = nz > np.maximum(nx, ny), nx > ny
    u = np.where(facing_up, x, np.where(facing_x, y, x))
    v = np.where(facing_up, y, z)
    if solid.pattern == "striped":
        return np.where(facing_up, x, z) / 0.44 % 1 < 0.42
    if solid.pattern == "checkered":
        return (np.floor(u / 0.3 + 0.5) + np.floor(v / 0.3 + 0.5)) % 2 == 0
    row = np.floor(v / 0.34)
    du, dv = (u / 0.4 + 0.5 * row) % 1 - 0.5, v / 0.34 % 1 - 0.5
    return (0.4 * du) ** 2 + (0.34 * dv) ** 2 < 0.125**2

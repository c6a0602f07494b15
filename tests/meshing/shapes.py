"""Objects whose surface is known by formula: points [N, 3] -> [N], positive inside, most of them distances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dreamfields_core.meshing import colors_from, vertex_normals
from dreamfields_core.types import Mesh

Shape = Callable[[np.ndarray], np.ndarray]


def sphere(points: np.ndarray, radius: float = 0.6, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    return radius - np.linalg.norm(points - np.asarray(centre, points.dtype), axis=1)


def colored(mesh: Mesh, colors: Callable[[np.ndarray], np.ndarray], *, inset: float = 0.0) -> Mesh:
    """The mesh with colours asked `inset` world units below each vertex."""
    return replace(mesh, colors=colors_from(colors, mesh.vertices - inset * vertex_normals(mesh)))


def torus(points: np.ndarray) -> np.ndarray:
    return 0.2 - np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.6, points[:, 2])


def box(points: np.ndarray) -> np.ndarray:
    return (np.asarray([0.503, 0.411, 0.307], points.dtype) - np.abs(points)).min(axis=1)


def plate(points: np.ndarray) -> np.ndarray:
    """Thinner than a coarse cell."""
    return np.minimum(0.7 - np.abs(points[:, :2]).max(axis=1), 0.012 - np.abs(points[:, 2] - 0.003))


def wire(points: np.ndarray) -> np.ndarray:
    """A tilted hoop whose thickness is less than a coarse cell."""
    x, y, z = points[:, 0], 0.8 * points[:, 1] - 0.6 * points[:, 2], 0.6 * points[:, 1] + 0.8 * points[:, 2]
    return 0.012 - np.hypot(np.hypot(x, y) - 0.61, z)


def gyroid(points: np.ndarray) -> np.ndarray:
    """A wall of many handles, cut off by a ball."""
    x, y, z = 6 * points.T
    wall = 0.5 - np.abs(np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x))
    return np.minimum(wall / 9, sphere(points, 0.8))


def two_spheres(points: np.ndarray) -> np.ndarray:
    return np.maximum(sphere(points, 0.3, (0.4, 0.0, 0.0)), sphere(points, 0.2, (-0.4, 0.0, 0.0)))


def specks(points: np.ndarray) -> np.ndarray:
    """A ball and a grain of a fifth of a coarse cell that no coarse corner lies in."""
    return np.maximum(sphere(points, 0.3), sphere(points, 0.006, (0.7156, 0.7156, 0.7156)))


def through_the_wall(points: np.ndarray) -> np.ndarray:
    return sphere(points, 0.6, (0.8, 0.8, 0.0))


SHAPES: dict[str, Shape] = {
    shape.__name__: shape for shape in (sphere, torus, box, plate, wire, gyroid, two_spheres, specks, through_the_wall)
}

VOLUMES = {
    "sphere": 4 / 3 * np.pi * 0.6**3,
    "torus": 2 * np.pi**2 * 0.6 * 0.2**2,
    "box": 8 * 0.503 * 0.411 * 0.307,
    "plate": 1.4**2 * 0.024,
    "two_spheres": 4 / 3 * np.pi * (0.3**3 + 0.2**3),
}

HANDLES = {"sphere": 2, "torus": 0, "box": 2, "plate": 2, "wire": 0, "two_spheres": 4, "specks": 4, "through_the_wall": 2}
"""Euler characteristics."""


def cameras(count: int, side: int, *, width: float = 2.4, distance: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """Rays of pinhole cameras around the scene, 20 degrees up: origins, directions [count, side, side, 3]."""
    turns = 2 * np.pi * np.arange(count) / count
    back = np.stack([np.cos(turns) * np.cos(0.35), np.sin(turns) * np.cos(0.35), np.full(count, np.sin(0.35))], axis=-1)
    right = np.stack([-np.sin(turns), np.cos(turns), np.zeros(count)], axis=-1)
    up = np.cross(back, right)
    grid = ((np.arange(side) + 0.5) / side - 0.5) * width
    across, down = np.meshgrid(grid, -grid)
    spots = across[None, ..., None] * right[:, None, None] + down[None, ..., None] * up[:, None, None]
    directions = spots - distance * back[:, None, None]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.broadcast_to(distance * back[:, None, None], directions.shape), directions

"""A small globe whose texture, normal map and colours are known by formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dreamfields_core.types import Mesh, Texture

SIZE = np.array([0.9, 0.6, 0.3])
"""Half-axes: no two alike, so that a turn or a mirror shows in the bounds."""
CENTRE = np.array([0.1, -0.2, 0.3])


def globe(rings: int = 12, *, side: int = 64) -> Mesh:
    """An ellipsoid: u runs eastward once around Z, v from the south pole to the north, one seam; with a normal map of small waves."""
    v, u = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, rings + 1), np.linspace(0, 1, 2 * rings + 1), indexing="ij"))
    sphere = on_sphere(u, v)
    corner = np.arange((rings + 1) * (2 * rings + 1)).reshape(rings + 1, 2 * rings + 1)
    south_west, south_east, north_west, north_east = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    lower = np.stack([south_west, south_east, north_east], axis=-1)[1:]  # at the south pole they would have no area
    upper = np.stack([south_west, north_east, north_west], axis=-1)[:-1]
    normals = sphere / SIZE
    return Mesh(
        vertices=(CENTRE + SIZE * sphere).astype(np.float32),
        faces=np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)]).astype(np.int32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        uv=np.stack([u, v], axis=-1).astype(np.float32),
        texture=Texture(painted(side), waves(side)),
    )


def painted_globe(rings: int = 12) -> Mesh:
    """The same with colours of its vertices and no texture."""
    mesh = globe(rings)
    assert mesh.uv is not None
    return replace(mesh, uv=None, texture=None, colors=color_at(*mesh.uv.T).astype(np.float32))


def on_sphere(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """[N, 3] unit vectors."""
    east, up = 2 * np.pi * u, np.pi * (v - 0.5)
    return np.stack([np.cos(east) * np.cos(up), np.sin(east) * np.cos(up), np.sin(up)], axis=-1)


def color_at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """[..., 3] display colours: red grows northward, green is largest at u = 1/4, blue marks the west of the first meridian."""
    return np.stack([v, 0.5 + 0.5 * np.sin(2 * np.pi * u), np.where(u > 0.5, 0.8, 0.2)], axis=-1)


def painted(side: int) -> np.ndarray:
    """uint8 [side, side, 3], row 0 at the top."""
    centres = (np.arange(side) + 0.5) / side
    return np.rint(255 * color_at(*np.meshgrid(centres, 1 - centres))).astype(np.uint8)


def waves(side: int) -> np.ndarray:
    """A normal map uint8 [side, side, 3] that leans along u in waves."""
    lean = 0.3 * np.sin(8 * np.pi * (np.arange(side) + 0.5) / side) * np.ones((side, 1))
    normal = np.stack([lean, 0 * lean, np.sqrt(1 - lean**2)], axis=-1)
    return np.rint(255 * (0.5 * normal + 0.5)).astype(np.uint8)

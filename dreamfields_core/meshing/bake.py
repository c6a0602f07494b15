"""Textures baked from the field: every texel asks at its own point of the surface.

The colour of 1024 x 1024 points is kept, however few faces carry it; a normal map keeps what simplification took from the shape.
"""

from __future__ import annotations

import numpy as np

from dreamfields_core.meshing.rasterise import Texels, at, rasterise
from dreamfields_core.meshing.surface import Surface, gradients, onto_surface, outward
from dreamfields_core.meshing.tangents import vertex_tangents
from dreamfields_core.types import Mesh, Texture

AT_ONCE = 1 << 19
"""Texels baked in one go; bounds the memory."""


def bake(mesh: Mesh, slopes: np.ndarray, surface: Surface, size: int, *, normal_map: bool = False) -> Texture:
    """The field's colours, and on demand its normals, on the texture of a mesh that has uv and normals.

    slopes: [V], see `surface.with_normals`. size: texels a side. Texels between the charts repeat the nearest one inside, so that
    smaller mip levels mix no foreign colour in.

    Raises:
      FieldNotFinite: the field's answer is no number.
    """
    assert mesh.uv is not None and mesh.normals is not None, "a bake needs a mesh with uv and normals"
    texels = rasterise(mesh.uv, mesh.faces, size)
    color = np.zeros((size, size, 3), np.uint8)
    bumps = np.zeros((size, size, 3), np.uint8) if normal_map else None
    tangents = vertex_tangents(mesh) if normal_map else None
    for start in range(0, len(texels.rows), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        place = texels.rows[part], texels.columns[part]
        smooth = unit(at(mesh.normals, mesh, texels, part))
        points = _settled(mesh, slopes, surface, texels, part, smooth)
        fine = smooth
        if bumps is not None and tangents is not None:
            fine = unit(outward(gradients(surface.ask, points, surface.cell), smooth))
            bumps[place] = levels(0.5 * (1 + in_frame(fine, smooth, at(tangents, mesh, texels, part))))
        color[place] = levels(surface.colors(points, fine))
    return Texture(spread(color, texels), None if bumps is None else spread(bumps, texels))


def _settled(mesh: Mesh, slopes: np.ndarray, surface: Surface, texels: Texels, part: slice, smooth: np.ndarray) -> np.ndarray:
    """[n, 3] where the texels of a part lie on the field's surface."""
    flat = at(mesh.vertices, mesh, texels, part)
    return onto_surface(surface, flat, smooth, at(slopes[:, None], mesh, texels, part)[:, 0], reach_of(mesh, surface.cell))


def reach_of(mesh: Mesh, cell: float) -> float:
    """How far a face may lie off the surface: a cell, or a quarter of the mean edge of large faces."""
    a, b = np.asarray(mesh.vertices, np.float64)[mesh.faces[:, 0]], np.asarray(mesh.vertices, np.float64)[mesh.faces[:, 1]]
    return max(cell, 0.25 * float(np.linalg.norm(b - a, axis=1).mean()))


def in_frame(normals: np.ndarray, smooth: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """Unit normals [n, 3] along (u, v, outward) of the frame that a reader builds from its normal and tangent [n, 4] (w last).

    No component points into the surface: a reader would show a hole.
    """
    along = unit(tangents[:, :3] - smooth * (smooth * tangents[:, :3]).sum(axis=1, keepdims=True))
    up = np.sign(tangents[:, 3:]) * np.cross(smooth, along)
    inside = np.stack([(normals * axis).sum(axis=1) for axis in (along, up, smooth)], axis=-1)
    return unit(np.concatenate([inside[:, :2], np.maximum(inside[:, 2:], 0.1)], axis=1))


def spread(picture: np.ndarray, texels: Texels) -> np.ndarray:
    """The picture [S, S, 3] with the texels between the charts filled from the nearest one inside."""
    filled = picture[tuple(texels.nearest)]
    filled[texels.rows, texels.columns] = picture[texels.rows, texels.columns]
    return filled


def unit(vectors: np.ndarray) -> np.ndarray:
    """[n, 3] of length 1; 0 stays 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30))


def levels(values: np.ndarray) -> np.ndarray:
    """[0, 1] to the nearest of 256 levels."""
    return np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)

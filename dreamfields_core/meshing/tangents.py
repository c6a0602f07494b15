"""The frames in which files expect normals and normal maps: a unit normal and a unit tangent a vertex."""

from __future__ import annotations

import numpy as np

from dreamfields_core.meshing.color import vertex_normals
from dreamfields_core.types import Mesh


def unit_normals(mesh: Mesh) -> np.ndarray:
    """[V, 3] float32 unit normals: the mesh's own where it has some, else its faces'; straight up where both vanish."""
    normals = np.asarray(vertex_normals(mesh) if mesh.normals is None else mesh.normals, np.float64)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    # Readers refuse a normal of no length, and every direction is as good for a vertex without area.
    return np.where(length > 1e-12, normals / np.maximum(length, 1e-12), [0.0, 0.0, 1.0]).astype(np.float32)


def vertex_tangents(mesh: Mesh) -> np.ndarray:
    """[V, 4] float32: unit tangents along +u, and w = 1 or -1 such that w cross(normal, tangent) points along +v, up the texture.

    dP/du of each face, weighed by its area, summed at its vertices, made perpendicular to the normal (glTF 2.0, section 3.7.2.1).
    """
    assert mesh.uv is not None, "tangents follow the texture: expected a mesh with uv"
    vertices, uv, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.uv, np.float64), np.asarray(mesh.faces)
    (a, b, c), (p, q, r) = np.moveaxis(vertices[faces], 1, 0), np.moveaxis(uv[faces], 1, 0)
    (u1, v1), (u2, v2) = (q - p).T, (r - p).T
    # dP/du = (e1 v2 - e2 v1) / det, and its direction needs the sign of det only: slivers in the texture do not blow up.
    turn = np.sign(u1 * v2 - u2 * v1)
    along = ((b - a) * v2[:, None] - (c - a) * v1[:, None]) * turn[:, None]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-30)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    tangents = _sum_at_vertices(along * area[:, None], faces, len(vertices))
    mirrored = _sum_at_vertices((turn * area)[:, None], faces, len(vertices))[:, 0] < 0
    normals = unit_normals(mesh).astype(np.float64)
    tangents -= normals * (normals * tangents).sum(axis=1, keepdims=True)
    length = np.linalg.norm(tangents, axis=1, keepdims=True)
    unit = np.where(length > 1e-12, tangents / np.maximum(length, 1e-12), _any_perpendicular(normals))
    return np.concatenate([unit, np.where(mirrored, -1.0, 1.0)[:, None]], axis=1).astype(np.float32)


def _sum_at_vertices(values: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """[F, K] a face -> [count, K], each face's value added to its three vertices."""
    corners, repeated = faces.ravel(), np.repeat(values, 3, axis=0)
    return np.stack([np.bincount(corners, weights=column, minlength=count) for column in repeated.T], axis=-1)


def _any_perpendicular(normals: np.ndarray) -> np.ndarray:
    """[V, 3] unit vectors perpendicular to unit normals: away from the axis that each is least along."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    across = np.cross(normals, axis)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))

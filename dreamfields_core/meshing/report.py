"""What a mesh is, counted: closed, manifold, in how many pieces, how large."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dreamfields_core.meshing.pieces import components, pieces, volume
from dreamfields_core.types import Mesh


@dataclass(frozen=True)
class MeshReport:
    """watertight: every edge belongs to two faces that run along it in opposite directions.
    manifold: no edge has more than two faces, and the faces around each vertex form one fan.
    winding: no two faces run along their common edge in the same direction.
    components: pieces connected by shared vertices. volume: world units cubed, positive when it winds outward.
    euler: vertices - edges + faces, 2 for each closed piece without handles.
    crossing: faces that cut another one, None where nobody looked.
    """

    vertices: int
    faces: int
    components: int
    euler: int
    volume: float
    watertight: bool
    manifold: bool
    winding: bool
    crossing: int | None = None


def report(mesh: Mesh, *, crossing: int | None = None) -> MeshReport:
    """Count, of one face at least; vertices that no face uses are left out. crossing: as `simplify.Simplified` has it.

    A textured mesh has its vertices doubled at seams: count it before it is unwrapped, or `pieces.weld` it.
    """
    faces = np.asarray(mesh.faces, np.int64)
    used = np.unique(faces)
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    _, edge, count = np.unique(low * (len(mesh.vertices) + 1) + high, return_inverse=True, return_counts=True)
    turning = np.bincount(edge, weights=np.where(starts < ends, 1, -1), minlength=len(count))
    closed = bool((count == 2).all())
    return MeshReport(
        vertices=len(used),
        faces=len(faces),
        components=len(np.unique(pieces(mesh))),
        euler=len(used) - len(count) + len(faces),
        volume=volume(mesh),
        watertight=closed and bool((turning == 0).all()),
        manifold=bool((count <= 2).all() and _fans(faces, edge) == len(used)),
        winding=bool((np.abs(turning) <= 1).all()),
        crossing=crossing,
    )


def _fans(faces: np.ndarray, edge: np.ndarray) -> int:
    """How many fans of faces there are around all vertices: corners of faces are joined across the edges that they share."""
    corner = np.arange(faces.size).reshape(-1, 3)
    owner = np.concatenate([corner.ravel(), np.roll(corner, -1, axis=1).ravel()])
    # An edge's two ends join their own corners only, so a joint is an (edge, vertex).
    _, joint = np.unique(np.concatenate([edge, edge]) * (faces.max() + 1) + faces.ravel()[owner], return_inverse=True)
    labels = components(faces.size + joint.max() + 1, owner, faces.size + joint)
    return len(np.unique(labels[: faces.size]))

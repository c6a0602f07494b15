"""The connected pieces of a mesh, and which of them are worth keeping."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dreamfields_core.meshing.level import Views
from dreamfields_core.meshing.raycast import cast
from dreamfields_core.types import Mesh


def pieces(mesh: Mesh) -> np.ndarray:
    """[F] the number of the connected piece that each face belongs to."""
    faces = np.asarray(mesh.faces, np.int64)
    return components(len(mesh.vertices), faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel())[faces[:, 0]]


def drop_loose(mesh: Mesh, share: float) -> Mesh:
    """Without the pieces whose area is below this share of the largest one's, and without cavities. For closed pieces, as `march` gives.

    A cavity winds inward, so its volume is negative; nobody sees it, and it would eat the face budget. The largest piece stays.
    """
    if not len(mesh.faces):
        return mesh
    piece = pieces(mesh)
    area = np.bincount(piece, weights=areas(mesh))
    good = (area >= share * area.max()) & (np.bincount(piece, weights=tetrahedra(mesh)) >= 0)
    good[np.argmax(area)] = True
    return compact(mesh, good[piece])


def drop_unseen(mesh: Mesh, views: Views) -> Mesh:
    """Without the pieces that the field does not show: of the rays that meet one first, most must have been opaque to the renderer.

    What is left of haze is met by clear rays; what is hidden, or smaller than the pixels, by none. The piece that most opaque rays
    meet stays.
    """
    piece = pieces(mesh)
    hits = cast(mesh, views.origins, views.directions)
    met, opaque = piece[hits.face[hits.hit]], np.asarray(views.opacity)[hits.hit] > 0.5
    solid, clear = (np.bincount(met[mask], minlength=piece.max() + 1) for mask in (opaque, ~opaque))
    good = solid > clear
    good[np.argmax(solid)] = True
    return compact(mesh, good[piece])


def flip(mesh: Mesh) -> Mesh:
    """Inside out."""
    return Mesh(vertices=mesh.vertices, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), colors=mesh.colors)


def turn_outward(mesh: Mesh) -> Mesh:
    """Every piece with a positive volume. For meshes without cavities."""
    piece = pieces(mesh)
    inward = (np.bincount(piece, weights=tetrahedra(mesh)) < 0)[piece]
    return Mesh(vertices=mesh.vertices, faces=np.where(inward[:, None], mesh.faces[:, ::-1], mesh.faces), colors=mesh.colors)


def compact(mesh: Mesh, keep: np.ndarray) -> Mesh:
    """Only the faces [F] kept, and only the vertices that they use, in their old order."""
    used, faces = np.unique(mesh.faces[keep], return_inverse=True)
    colors = None if mesh.colors is None else mesh.colors[used]
    return Mesh(vertices=mesh.vertices[used], faces=faces.reshape(-1, 3).astype(np.int32), colors=colors)


def weld(mesh: Mesh) -> Mesh:
    """Vertices at the same place become one: undoes the seams of a texture. Only the shape is kept."""
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return Mesh(vertices=vertices, faces=index.reshape(-1)[mesh.faces].astype(np.int32))


def volume(mesh: Mesh) -> float:
    """The sum of signed tetrahedra from the mean vertex (Zhang and Chen, ICIP 2001), in float64."""
    return float(tetrahedra(mesh).sum())


def tetrahedra(mesh: Mesh) -> np.ndarray:
    """[F] signed volumes between each face and the mean vertex; a closed piece's add up to its own volume."""
    if not len(mesh.faces):
        return np.zeros(0)
    vertices = np.asarray(mesh.vertices, np.float64)
    a, b, c = np.moveaxis((vertices - vertices.mean(axis=0))[mesh.faces], 1, 0)
    return np.einsum("fi,fi->f", a, np.cross(b, c)) / 6


def areas(mesh: Mesh) -> np.ndarray:
    """[F] areas of the faces."""
    a, b, c = np.moveaxis(np.asarray(mesh.vertices, np.float64)[mesh.faces], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def components(count: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[count] labels of nodes that are joined pairwise, a [n] to b [n]."""
    return np.asarray(connected_components(coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(count, count)), directed=False)[1])

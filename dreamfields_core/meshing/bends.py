"""Extracted triangles cut where the surface bends much within one: the chord over an arc misses it by about its length x the turn / 8.

A wire of one and a half cells is a hexagon otherwise. Where no edge bends too much, as on nearly all of a dream, nothing is asked and
nothing changes.

Symbols: an edge's ends have unit normals whose angle is the turn; its bow is length x turn / 8, the height of an arc over its chord.
"""

from __future__ import annotations

import numpy as np

from dreamfields_core.meshing.color import vertex_normals
from dreamfields_core.meshing.lattice import Lattice, Packed, Samples
from dreamfields_core.types import Mesh

BOW = 0.02
"""Cells: edges that bow more are cut."""
REACH = 0.2
"""Lengths of the edge: how far a new vertex may move off it; an arc over a right angle is that high."""
STEPS = 2
"""Of the secant method, that move it onto the surface."""


def cut_bends(mesh: Mesh, samples: Samples, level: float) -> Mesh:
    """The mesh with a vertex on the surface in the middle of every edge that bows too much; closed and manifold where it was.

    Edges that end at the bounds are left: there the surface is the bound itself. Where a face would fold over, its new vertices stay
    on their chords.
    """
    edges, number = _edges(mesh)
    cut = _bowed(mesh, edges, samples.lattice)
    if not cut.any():
        return mesh
    added = np.full(len(edges), -1)
    added[cut] = len(mesh.vertices) + np.arange(cut.sum())
    faces = split(np.asarray(mesh.faces, np.int64), added[number])
    middle, placed = _placed(mesh, edges[cut], samples, level)
    flat, moved = (np.concatenate([mesh.vertices, points]) for points in (middle, placed))
    folded = np.isin(np.arange(len(mesh.vertices), len(flat)), faces[_turned_over(moved, faces, flat)])
    vertices = np.concatenate([mesh.vertices, np.where(folded[:, None], middle, placed)])
    return Mesh(vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))


def _edges(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """([E, 2] vertices of every edge, [F, 3] which of them runs from each corner to the next)."""
    faces = np.asarray(mesh.faces, np.int64)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    keys, number = np.unique(ends[:, 0] * len(mesh.vertices) + ends[:, 1], return_inverse=True)
    return np.stack([keys // len(mesh.vertices), keys % len(mesh.vertices)], axis=1), number.reshape(-1, 3)


def _bowed(mesh: Mesh, edges: np.ndarray, lattice: Lattice) -> np.ndarray:
    """[E] which edges bow too much, of those within the bounds."""
    ends, normals = np.asarray(mesh.vertices, np.float64)[edges], vertex_normals(mesh)[edges]
    turn = np.arccos(np.clip((normals[:, 0] * normals[:, 1]).sum(axis=1), -1, 1))
    within = np.abs(ends - lattice.origin).max(axis=(1, 2)) <= lattice.bound
    return np.asarray(within & (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) * turn / 8 > BOW * lattice.cell))


def _placed(mesh: Mesh, edges: np.ndarray, samples: Samples, level: float) -> tuple[np.ndarray, np.ndarray]:
    """([E, 3] middles of edges, [E, 3] the same on the surface)."""
    ends, outward = np.asarray(mesh.vertices, np.float64)[edges], vertex_normals(mesh)[edges].sum(axis=1)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    reach = REACH * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    middle, lattice = ends.mean(axis=1), samples.lattice
    low, high = np.asarray(lattice.origin) - lattice.bound, np.asarray(lattice.origin) + lattice.bound
    return middle, np.clip(onto(samples.ask, level, middle, outward, reach), low, high)


def _turned_over(vertices: np.ndarray, faces: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """[F] which faces look more than 60 degrees away from where they looked among the vertices `flat`."""
    normals = []
    for points in (vertices, flat):
        a, b, c = np.moveaxis(np.asarray(points, np.float64)[faces], 1, 0)
        normals.append(np.cross(b - a, c - a))
    lengths = np.linalg.norm(normals[0], axis=1) * np.linalg.norm(normals[1], axis=1)
    return np.asarray((normals[0] * normals[1]).sum(axis=1) < 0.5 * lengths)


def onto(ask: Packed, level: float, points: np.ndarray, outward: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Points [N, 3] moved along `outward` [N, 3] onto the level, at most `reach` [N]; those that find none stay.

    The secant method, from the point and one a little further towards the surface.
    """
    before, g_before = np.zeros(len(points)), ask(points).astype(np.float64) - level
    here = 0.1 * reach * np.where(g_before > 0, 1, -1)
    start = np.abs(g_before)
    for _ in range(STEPS):
        g = ask(points + here[:, None] * outward).astype(np.float64) - level
        fall = (g - g_before) / np.where(here != before, here - before, 1)
        move = np.where(fall < 0, -g / np.minimum(fall, -1e-30), 0)
        before, g_before, here = here, g, np.clip(here + move, -reach, reach)
    better = np.abs(ask(points + here[:, None] * outward).astype(np.float64) - level) < start
    return np.asarray(points + np.where(better, here, 0)[:, None] * outward)


def split(faces: np.ndarray, added: np.ndarray) -> np.ndarray:
    """Faces [F, 3] cut at the vertices added [F, 3] on their edges 0-1, 1-2, 2-0, -1 where there is none; the same winding."""
    count = (added >= 0).sum(axis=1)
    # Turned so that the cut edge comes first; of two, so that the whole one comes last.
    turn = np.where(count == 1, np.argmax(added >= 0, axis=1), np.where(count == 2, (np.argmin(added, axis=1) + 1) % 3, 0))
    order = (turn[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, ca) = np.take_along_axis(faces, order, axis=1).T, np.take_along_axis(added, order, axis=1).T
    pieces = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    return np.concatenate([np.stack(piece, axis=1)[count == cuts] for cuts, parts in pieces.items() for piece in parts])

"""Which texel of a texture lies on which face: triangles filled in the plane of the texture.

Symbols: x to the right and y down in texels, a texel's centre at whole numbers; S the side of the texture.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import distance_transform_edt

from dreamfields_core.types import Mesh

RIM = 2.0
"""Texels around a chart that lie on its surface prolonged: what a lookup between four texels reads at the chart's edge."""

AT_ONCE = 1 << 21
"""Candidates tested in one go; bounds the memory."""

STRETCH = 2.0
"""Barycentric weights of prolonged faces are kept within [-STRETCH, 1 + STRETCH]: a sliver prolonged goes anywhere."""


@dataclass(frozen=True)
class Texels:
    """The texels that show the surface, and where all the others take theirs from.

    rows, columns: [N]. face: [N]. weights: [N, 3] barycentric, adding up to 1, beyond [0, 1] on the rim.
    nearest: [2, S, S] row and column of the nearest texel inside a chart, for every texel.
    """

    rows: np.ndarray
    columns: np.ndarray
    face: np.ndarray
    weights: np.ndarray
    nearest: np.ndarray


def rasterise(uv: np.ndarray, faces: np.ndarray, size: int) -> Texels:
    """The texels of a square texture that the faces [F, 3] cover by uv [V, 2] (v up), and those within RIM of them."""
    corners = np.stack([uv[:, 0] * size - 0.5, (1 - uv[:, 1]) * size - 0.5], axis=-1).astype(np.float64)[faces]
    owner = covering(corners, size)
    assert (owner >= 0).any(), "no texel lies on the mesh: its uv are all alike"
    distance, nearest = distance_transform_edt(owner < 0, return_indices=True)
    rows, columns = np.nonzero(distance <= RIM)
    face = owner[tuple(nearest[:, rows, columns])]
    weights = barycentric(corners[face], np.stack([columns, rows], axis=-1))
    weights = np.clip(weights, -STRETCH, 1 + STRETCH)
    return Texels(rows, columns, face, weights / weights.sum(axis=1, keepdims=True), nearest)


def covering(corners: np.ndarray, size: int) -> np.ndarray:
    """[S, S] the face whose triangle, corners [F, 3, 2], holds the texel's centre; -1 for none. Charts do not overlap."""
    low = np.clip(np.ceil(corners.min(axis=1)), 0, size - 1).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1)), -1, size - 1).astype(np.int64)
    width, height = np.maximum(high - low + 1, 0).T
    owner = np.full((size, size), -1, np.int32)
    count = width * height
    wanted = np.flatnonzero(count)
    # Whole faces a block; a face larger than a block is a block alone.
    block = np.cumsum(count[wanted]) // AT_ONCE
    for start, end in _runs(block):
        inside_block(owner, corners, wanted[start:end], low, width, count)
    return owner


def inside_block(owner: np.ndarray, corners: np.ndarray, which: np.ndarray, low: np.ndarray, width: np.ndarray, count: np.ndarray) -> None:
    """Write the faces `which` into `owner`: every texel of each one's bounding box is tried."""
    face = np.repeat(which, count[which])
    rank = np.arange(len(face)) - np.repeat(np.cumsum(count[which]) - count[which], count[which])
    x, y = low[face, 0] + rank % width[face], low[face, 1] + rank // width[face]
    inside = (barycentric(corners[face], np.stack([x, y], axis=-1)) >= 0).all(axis=1)
    owner[y[inside], x[inside]] = face[inside]


def barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights [N, 3] of points [N, 2] in triangles [N, 3, 2], of either turning sense; all -1 for a triangle without area."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = _cross(b - a, c - a)
    safe = np.where(area == 0, 1, area)
    u, v = _cross(points - a, c - a) / safe, _cross(b - a, points - a) / safe
    return np.where((area == 0)[:, None], -1.0, np.stack([1 - u - v, u, v], axis=-1))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _runs(labels: np.ndarray) -> list[tuple[int, int]]:
    """(start, end) of each run of equal labels."""
    cuts = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    return list(pairwise(cuts))


def at(values: np.ndarray, mesh: Mesh, texels: Texels, part: slice) -> np.ndarray:
    """Vertex values [V, K] at the texels of a part, [n, K] float64: between the corners of each one's face."""
    return np.einsum("nk,nkc->nc", texels.weights[part], np.asarray(values, np.float64)[mesh.faces[texels.face[part]]])

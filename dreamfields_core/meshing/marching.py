"""Triangles for the cells that the surface crosses, their vertices slid along the crossed edges onto the surface.

Symbols: an edge runs from its low corner along one axis; t in (0, 1) is the vertex's place on it; g is the field minus the level.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dreamfields_core.meshing.cases import CORNERS, EDGES, table
from dreamfields_core.meshing.lattice import Lattice, Samples
from dreamfields_core.types import Mesh

CLOSE = 1e-3
"""A vertex is asked no further when it is this share of its edge from the root, by the flatter of the two secants through it."""

MARGIN = 1e-3
"""Vertices keep this share of a cell away from the lattice's corners: six edges meet there, and equal vertices make null faces."""


def march(samples: Samples, cells: np.ndarray, level: float, *, steps: int = 2) -> Mesh:
    """The surface in the cells [K, 3] as one mesh with shared vertices, outward winding."""
    lattice = samples.lattice
    edges, faces = _triangles(lattice, cells, samples.at(cells[:, None] + CORNERS) > level)
    low, along = lattice.corners(edges // 3), np.eye(3, dtype=np.int64)[edges % 3]
    t = _false_position(samples, low, along, level, steps)
    return Mesh(vertices=lattice.place(low + t[:, None] * along).astype(np.float32), faces=faces.astype(np.int32))


def _triangles(lattice: Lattice, cells: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(edges [V], 3 x the key of the low corner + the axis; faces [F, 3] that point into them) for inside [K, 8]."""
    triangles, first, count = table()
    case = inside @ (1 << np.arange(8))
    owner = np.repeat(np.arange(len(cells)), count[case])
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(count[case]) - count[case], count[case])
    local = triangles[first[case][owner] + rank]
    low = CORNERS[[ends[0] for ends in EDGES]]
    global_edges = 3 * lattice.key(cells[owner][:, None] + low[local]) + local // 4
    edges, faces = np.unique(global_edges, return_inverse=True)
    return edges, faces.reshape(-1, 3)


def _false_position(samples: Samples, low: np.ndarray, along: np.ndarray, level: float, steps: int) -> np.ndarray:
    """t [V] in [MARGIN, 1 - MARGIN], at most `steps` more questions a vertex."""
    g_left = samples.at(low).astype(np.float64) - level
    g_right = samples.at(low + along).astype(np.float64) - level

    def g_at(which: np.ndarray, t: np.ndarray) -> np.ndarray:
        return samples.ask(samples.lattice.place(low[which] + t[:, None] * along[which])).astype(np.float64) - level

    # The layer outside the cube has no values: there the surface is the bound itself.
    t = np.where(np.isinf(g_left), 1.0, 0.0)
    inner = np.flatnonzero(np.isfinite(g_left) & np.isfinite(g_right))
    t[inner] = illinois(lambda which, t: g_at(inner[which], t), g_left[inner], g_right[inner], steps)
    return np.clip(t, MARGIN, 1 - MARGIN)


def illinois(g_at: Callable[[np.ndarray, np.ndarray], np.ndarray], g_left: np.ndarray, g_right: np.ndarray, steps: int) -> np.ndarray:
    """Roots t [V] in [0, 1] of functions with the end values given, one of which is positive and the other not.

    The Illinois variant of false position (Dowell and Jarratt, BIT 11, 1971): it keeps the root bracketed, so a vertex never
    leaves its edge, and needs no gradient; two steps come as close as Newton's. g_at: (indices [n], t [n]) -> values [n].
    """
    left, right, g_left, g_right = np.zeros(len(g_left)), np.ones(len(g_left)), g_left.copy(), g_right.copy()
    kept = np.zeros(len(left))  # which end stayed in the last step: -1 left, +1 right
    t = left - g_left * (right - left) / (g_right - g_left)
    which = np.arange(len(t))
    for _ in range(steps):
        g = g_at(which, t[which])
        far_left = np.abs(g) * (t - left)[which] > CLOSE * np.abs(g - g_left[which])
        far_right = np.abs(g) * (right - t)[which] > CLOSE * np.abs(g_right[which] - g)
        which, g = (array[far_left | far_right] for array in (which, g))
        moves_left = (g > 0) == (g_left[which] > 0)
        i, j = which[moves_left], which[~moves_left]
        left[i], g_left[i] = t[i], g[moves_left]
        right[j], g_right[j] = t[j], g[~moves_left]
        # An end that stays twice in a row is weighed half, else it may stay for ever.
        g_right[i[kept[i] == 1]] /= 2
        g_left[j[kept[j] == -1]] /= 2
        kept[i], kept[j] = 1, -1
        t[which] = (left - g_left * (right - left) / (g_right - g_left))[which]
    return t

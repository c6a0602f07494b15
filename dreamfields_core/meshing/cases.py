"""The 256 cases of marching cubes, derived instead of listed.

Lorensen and Cline, "Marching cubes", SIGGRAPH 1987; the ambiguity that their table leaves open is settled face by face, from
the signs on that face alone, so that two cells always agree on the face they share and the surface has no holes.

A cell's corner c stands at (c & 1, c >> 1 & 1, c >> 2 & 1); bit c of a case says that corner c is inside. On each face the
boundary between inside and outside is a set of directed segments; head to tail they form closed loops, and each loop is
triangulated with no diagonal lying in a face: a neighbouring cell could draw the same one, and four triangles would
share an edge. Such a triangulation exists in all cases (a test looks), which makes the surface a manifold by construction.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

Triangle = tuple[int, int, int]

CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)])
"""[8, 3]."""

EDGES = [(c, c | 1 << axis) for axis in range(3) for c in range(8) if not c >> axis & 1]
"""12 pairs of corners, low end first; edge e runs along axis e // 4."""

_EDGE_OF = {frozenset(ends): edge for edge, ends in enumerate(EDGES)}
_MIDDLES = np.array([(CORNERS[a] + CORNERS[b]) / 2 for a, b in EDGES])


def _faces() -> Iterator[list[int]]:
    """The corners of each face, counter-clockwise seen from outside the cell."""
    for axis in range(3):
        u, v = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        ring = [0, u, u | v, v]
        yield ring[::-1]
        yield [corner | 1 << axis for corner in ring]


FACES = list(_faces())
_FACES_OF = [{number for number, face in enumerate(FACES) if set(ends) <= set(face)} for ends in EDGES]


def share_a_face(a: int, b: int) -> bool:
    """Whether two edges of the cell lie in one of its faces."""
    return bool(_FACES_OF[a] & _FACES_OF[b])


def loops(case: int) -> list[list[int]]:
    """The closed loops of edges in which the surface cuts the cell, counter-clockwise seen from outside the object."""
    following: dict[int, int] = {}
    for face in FACES:
        crossings = []
        for i in range(4):
            a, b = face[i], face[(i + 1) % 4]
            if (case >> a & 1) != (case >> b & 1):
                crossings.append((_EDGE_OF[frozenset((a, b))], bool(case >> b & 1)))
        for i, (edge, enters) in enumerate(crossings):
            if enters:  # pair it with the exit before it: two inside corners of a face that face each other stay joined
                following[edge] = crossings[i - 1][0]
    found = []
    while following:
        start = min(following)
        loop, edge = [start], following.pop(start)
        while edge != start:
            loop.append(edge)
            edge = following.pop(edge)
        found.append(loop)
    return found


def triangulations(polygon: list[int]) -> Iterator[list[Triangle]]:
    """All ways to cut a polygon into triangles, keeping its turning sense."""
    if len(polygon) < 3:
        yield []
        return
    for k in range(1, len(polygon) - 1):
        for left in triangulations(polygon[: k + 1]):
            for right in triangulations(polygon[k:]):
                yield [*left, (polygon[0], polygon[k], polygon[-1]), *right]


def diagonals(loop: list[int], triangles: list[Triangle]) -> list[tuple[int, int]]:
    """The cuts that a triangulation adds inside its loop."""
    sides = {frozenset((loop[i - 1], loop[i])) for i in range(len(loop))}
    pairs = {frozenset(pair) for a, b, c in triangles for pair in ((a, b), (b, c), (c, a))}
    return [(min(pair), max(pair)) for pair in sorted(pairs - sides, key=sorted)]


def _best(loop: list[int]) -> list[Triangle]:
    def cost(triangles: list[Triangle]) -> tuple[int, float]:
        cuts = diagonals(loop, triangles)
        return sum(share_a_face(a, b) for a, b in cuts), sum(float(np.square(_MIDDLES[a] - _MIDDLES[b]).sum()) for a, b in cuts)

    return min(triangulations(loop), key=cost)


@cache
def table() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(triangles [T, 3] of edges 0..11, first [256], count [256]): case k owns triangles first[k] : first[k] + count[k]."""
    cases = [[triangle for loop in loops(case) for triangle in _best(loop)] for case in range(256)]
    count = np.array([len(triangles) for triangles in cases])
    flat = np.array([triangle for triangles in cases for triangle in triangles])
    return flat, np.cumsum(count) - count, count

"""The derived table of marching cubes against what makes a surface closed and manifold."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dreamfields_core.meshing import report
from dreamfields_core.meshing.cases import CORNERS, EDGES, diagonals, loops, share_a_face, table
from dreamfields_core.meshing.isosurface import isosurface


def own(case: int) -> list[tuple[int, int, int]]:
    triangles, first, count = table()
    return [(int(a), int(b), int(c)) for a, b, c in triangles[first[case] : first[case] + count[case]]]


@pytest.mark.parametrize("case", range(256))
def test_every_crossed_edge_has_one_vertex_and_no_cut_lies_in_a_face(case: int) -> None:
    crossed = {edge for edge, (a, b) in enumerate(EDGES) if (case >> a & 1) != (case >> b & 1)}
    found = loops(case)
    assert Counter(edge for loop in found for edge in loop) == Counter(crossed)
    assert {edge for triangle in own(case) for edge in triangle} == crossed
    for loop in found:
        triangles = [triangle for triangle in own(case) if set(triangle) <= set(loop)]
        assert len(triangles) == len(loop) - 2
        assert not any(share_a_face(a, b) for a, b in diagonals(loop, triangles))


@pytest.mark.parametrize("corner", range(8))
def test_a_lone_corner_is_cut_off_with_the_normal_pointing_away_from_it(corner: int) -> None:
    middles = np.array([(CORNERS[a] + CORNERS[b]) / 2 for a, b in EDGES])
    ((a, b, c),) = (middles[list(triangle)] for triangle in own(1 << corner))
    assert np.cross(b - a, c - a) @ (a - CORNERS[corner]) > 0


@given(st.integers(0, 2**64 - 1))
def test_random_signs_make_closed_manifolds(seed: int) -> None:
    # Every face ambiguity occurs in noise; no smooth field tries them all.
    values = np.random.default_rng(seed).standard_normal((7, 7, 7)).astype(np.float32)

    def noise(points: np.ndarray) -> np.ndarray:
        index = np.rint((points + 1) * 3).astype(int)
        return values[tuple(index.T)]

    found = report(isosurface(noise, 0.0, resolution=6, steps=0, batch=343))
    assert found.watertight and found.manifold and found.volume > 0

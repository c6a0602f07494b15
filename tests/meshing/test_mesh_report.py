"""The counts on meshes that are known, good and bad."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dreamfields_core.meshing import MeshReport, report, weld
from dreamfields_core.types import Mesh

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.int32)


def test_a_tetrahedron() -> None:
    assert report(Mesh(vertices=CORNERS, faces=FACES)) == MeshReport(4, 4, 1, 2, report(Mesh(CORNERS, FACES)).volume, True, True, True)
    np.testing.assert_allclose(report(Mesh(CORNERS, FACES)).volume, 1 / 6)


def test_inside_out_is_negative_but_closed() -> None:
    found = report(Mesh(CORNERS, FACES[:, ::-1]))
    assert found.volume < 0 and found.watertight


def test_a_missing_and_a_turned_face_are_not_watertight() -> None:
    open_one, turned_one = (report(Mesh(CORNERS, faces)) for faces in (FACES[1:], np.concatenate([FACES[1:], FACES[:1, ::-1]])))
    assert not open_one.watertight and open_one.winding
    assert not turned_one.watertight and not turned_one.winding


def test_seams_are_welded_before_counting() -> None:
    cut = Mesh(CORNERS[FACES].reshape(-1, 3), np.arange(12, dtype=np.int32).reshape(-1, 3))
    assert report(cut).components == 4
    assert report(weld(cut), crossing=0) == replace(report(Mesh(CORNERS, FACES)), crossing=0)


def test_two_solids_that_share_a_vertex_are_closed_but_no_manifold() -> None:
    other = np.where(FACES == 0, 0, FACES + 3)
    found = report(Mesh(np.concatenate([CORNERS, -CORNERS[1:]]), np.concatenate([FACES, other[:, ::-1]])))
    assert found.watertight and not found.manifold and found.components == 1


def test_a_third_face_on_an_edge_is_no_manifold() -> None:
    found = report(Mesh(np.concatenate([CORNERS, [[5, 5, 5]]]), np.concatenate([FACES, [[0, 1, 4]]])))
    assert not found.manifold and not found.watertight


def test_unused_vertices_do_not_count() -> None:
    assert report(Mesh(np.concatenate([CORNERS, [[9, 9, 9]]]), FACES)).euler == 2

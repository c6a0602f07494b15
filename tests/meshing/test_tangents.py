"""Tangents against the derivative that they stand for, and the frame that readers rebuild from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dreamfields_core.meshing.tangents import unit_normals, vertex_tangents
from dreamfields_core.types import Mesh
from tests.meshing.textured import SIZE, globe


def inner(mesh: Mesh) -> np.ndarray:
    """Vertices away from the poles, where eastward means something."""
    assert mesh.uv is not None
    return np.abs(mesh.uv[:, 1] - 0.5) < 0.4


def test_tangents_point_along_u_and_the_frame_is_orthonormal() -> None:
    mesh = globe(48)
    assert mesh.uv is not None
    tangents, normals = vertex_tangents(mesh), unit_normals(mesh)
    east = np.stack([-np.sin(2 * np.pi * mesh.uv[:, 0]), np.cos(2 * np.pi * mesh.uv[:, 0]), 0 * mesh.uv[:, 0]], axis=-1) * SIZE
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    assert (tangents[:, :3] * east).sum(axis=1)[inner(mesh)].min() > 0.99
    np.testing.assert_allclose(np.linalg.norm(tangents[:, :3], axis=1), 1, atol=1e-6)
    np.testing.assert_allclose((tangents[:, :3] * normals).sum(axis=1), 0, atol=1e-6)


def test_the_third_axis_points_up_the_texture_and_turns_with_a_mirrored_one() -> None:
    mesh = globe(24)
    assert mesh.uv is not None
    mirrored = replace(mesh, uv=np.stack([1 - mesh.uv[:, 0], mesh.uv[:, 1]], axis=-1))
    for one, handedness in ((mesh, 1), (mirrored, -1)):
        tangents = vertex_tangents(one)
        assert (tangents[inner(mesh), 3] == handedness).all()
        up = tangents[:, 3:] * np.cross(unit_normals(one), tangents[:, :3])
        assert up[inner(mesh), 2].min() > 0.1  # v runs to the north pole


def test_faces_without_area_leave_every_frame_finite() -> None:
    mesh = globe(6)
    assert mesh.uv is not None
    for uv in (np.zeros_like(mesh.uv), np.full_like(mesh.uv, 0.5)):
        tangents = vertex_tangents(replace(mesh, uv=uv, normals=np.zeros_like(mesh.vertices)))
        np.testing.assert_allclose(np.linalg.norm(tangents[:, :3], axis=1), 1, atol=1e-6)

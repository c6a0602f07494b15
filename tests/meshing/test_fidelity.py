"""Fidelity of meshes whose distance from what was seen is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dreamfields_core.meshing import Seen, fidelity, isosurface
from dreamfields_core.meshing.fidelity import intersection_over_union, psnr
from dreamfields_core.types import Mesh
from tests.meshing.shapes import cameras, colored, sphere

ORIGINS, DIRECTIONS = cameras(2, 96)


def colors(points: np.ndarray) -> np.ndarray:
    return (points + 1) / 2


@pytest.fixture(scope="module")
def ball() -> Mesh:
    return colored(isosurface(sphere, 0.0, resolution=64), colors)


def seen_ball(radius: float = 0.6) -> Seen:
    """A hard ball about the origin, by formula."""
    along = -(ORIGINS * DIRECTIONS).sum(axis=-1)
    under = radius**2 - np.square(ORIGINS).sum(axis=-1) + along**2
    hit = under > 0
    depth = np.where(hit, along - np.sqrt(np.maximum(under, 0)), 0)
    color = np.where(hit[..., None], colors(ORIGINS + depth[..., None] * DIRECTIONS), 0)
    return Seen(ORIGINS, DIRECTIONS, hit.astype(float), color, depth)


def test_a_mesh_of_the_same_ball_agrees(ball: Mesh) -> None:
    found = fidelity(ball, seen_ball())
    assert found.silhouette is not None and found.silhouette > 0.99 and len(found.silhouettes) == 2
    assert found.image is not None and found.image > 25 and found.depth is not None and found.depth < 2e-3


def test_a_smaller_ball_loses_what_its_disc_loses(ball: Mesh) -> None:
    found = fidelity(replace(ball, vertices=ball.vertices * np.float32(0.8)), seen_ball())
    assert found.silhouette == pytest.approx(0.64, abs=0.02) and found.depth is not None and 0.05 < found.depth < 0.2


def test_wrong_colors_cost_the_image_alone(ball: Mesh) -> None:
    right, wrong = fidelity(ball, seen_ball()), fidelity(replace(ball, colors=np.zeros_like(ball.colors)), seen_ball())
    assert wrong.silhouette == right.silhouette and wrong.depth == right.depth
    assert wrong.image is not None and wrong.image < 10


def test_nothing_to_compare_is_no_number() -> None:
    away = Mesh(np.float32([[9, 9, 9], [9, 9, 10], [9, 10, 9]]), np.array([[0, 1, 2]], np.int32))
    nothing = replace(seen_ball(), opacity=np.zeros_like(seen_ball().opacity))
    found = fidelity(away, nothing)
    assert (found.silhouette, found.image, found.depth) == (None, None, None)
    assert fidelity(away, seen_ball()).silhouette == 0


def test_the_measures_by_hand() -> None:
    assert intersection_over_union(np.array([True, True, False]), np.array([True, False, True])) == pytest.approx(1 / 3)
    assert intersection_over_union(np.zeros(2, bool), np.zeros(2, bool)) is None
    assert psnr(np.zeros(4), np.full(4, 0.1)) == pytest.approx(20)
    assert psnr(np.zeros(4), np.zeros(4)) < 60

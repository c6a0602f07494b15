"""Rays against triangles, compared with a ball's closed form."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.meshing import cast, isosurface, render_mesh
from dreamfields_core.types import Mesh
from tests.meshing.shapes import cameras, colored, sphere

ORIGINS, DIRECTIONS = cameras(3, 128)


@pytest.fixture(scope="module")
def ball() -> Mesh:
    return colored(isosurface(sphere, 0.0, resolution=64), lambda p: (p + 1) / 2)


def closed_form() -> tuple[np.ndarray, np.ndarray]:
    """(hit, depth) of the ball."""
    along = -(ORIGINS * DIRECTIONS).sum(axis=-1)
    under = 0.6**2 - np.square(ORIGINS).sum(axis=-1) + along**2
    return under > 0, along - np.sqrt(np.maximum(under, 0))


def test_silhouette_is_a_disc(ball: Mesh) -> None:
    expected, _ = closed_form()
    assert (cast(ball, ORIGINS, DIRECTIONS).hit != expected).mean() < 0.001


def test_depth_color_and_normal(ball: Mesh) -> None:
    hit, depth = closed_form()
    seen = render_mesh(ball, ORIGINS, DIRECTIONS)
    both = hit & seen.hit & (depth < 3.8)  # the rim, where depth is steep, left out
    np.testing.assert_allclose(seen.depth[both], depth[both], atol=2e-3)
    points = ORIGINS + depth[..., None] * DIRECTIONS
    np.testing.assert_allclose(seen.color[both], ((points + 1) / 2)[both], atol=2e-3)
    assert (seen.color[~seen.hit] == 0).all() and (seen.depth[~seen.hit] == 0).all()
    hits = cast(ball, ORIGINS, DIRECTIONS)
    # Slivers of the extraction point a little aside, so the mean counts.
    assert (hits.normal[both] * (points / 0.6)[both]).sum(axis=-1).mean() > 0.999
    np.testing.assert_allclose(hits.weights.sum(axis=-1), 1, atol=1e-6)


def test_a_lamp_shades_and_no_colors_mean_grey(ball: Mesh) -> None:
    plain = Mesh(vertices=ball.vertices, faces=ball.faces)
    flat = render_mesh(plain, ORIGINS, DIRECTIONS)
    assert np.unique(flat.color[flat.hit].round(5)).tolist() == [0.75]
    lit = render_mesh(plain, ORIGINS, DIRECTIONS, light=np.array([0.0, 0.0, 1.0]))
    assert lit.color[lit.hit].std() > 0.05

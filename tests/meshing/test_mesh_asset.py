"""The whole way, from a field and some views to a coloured mesh."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.meshing import BadBudget, FieldNotFinite, MeshError, Views, colors_from, extract_mesh, silhouette, vertex_normals
from tests.meshing.shapes import cameras, sphere


def stripes(points: np.ndarray) -> np.ndarray:
    """A colour that is right inside the ball and black outside it."""
    inside = (np.linalg.norm(points, axis=1) < 0.6)[:, None]
    return np.where(inside, np.abs(points), 0)


def test_a_soft_ball_becomes_a_coloured_closed_mesh() -> None:
    traces = 0

    @jax.jit
    def field(points: jax.Array) -> jax.Array:
        nonlocal traces
        traces += 1
        return 4 - 10 * jnp.square(points).sum(axis=-1)

    origins, directions = cameras(3, 64)
    along = -(origins * directions).sum(axis=-1)
    opacity = (np.linalg.norm(origins + along[..., None] * directions, axis=-1) < 0.5).astype(float)
    told: list[int] = []
    made = extract_mesh(
        lambda p: np.asarray(field(p)),
        lambda p: np.full_like(p, 0.25),
        views=Views(origins, directions, opacity),
        resolution=128,
        faces=2000,
        progress=told.append,
    )
    assert made.report.watertight and made.report.manifold and made.report.faces <= 2000 and made.report.volume > 0
    assert made.level == pytest.approx(1.5, abs=0.3) and made.agreement is not None and made.agreement > 0.95
    assert np.all(np.asarray(made.mesh.colors) == 0.25) and made.asked == told[-1] and traces == 1
    seen = silhouette(made.mesh, origins, directions)
    assert (seen & (opacity > 0.5)).sum() / (seen | (opacity > 0.5)).sum() > 0.95
    assert made.extracted.faces > made.report.faces and made.extracted.watertight


def test_colors_are_asked_below_the_surface() -> None:
    made = extract_mesh(sphere, stripes, level=0.0, resolution=64, faces=4000)
    assert made.agreement is None and made.mesh.colors is not None
    np.testing.assert_allclose(made.mesh.colors, np.abs(made.mesh.vertices), atol=0.03)
    normals = vertex_normals(made.mesh)
    assert (normals * made.mesh.vertices / 0.6).sum(axis=1).min() > 0.99


def test_bad_settings_are_refused_before_the_field_is_asked() -> None:
    def never(points: np.ndarray) -> np.ndarray:
        raise AssertionError("asked")

    with pytest.raises(BadBudget):
        extract_mesh(never, never, level=0.0, faces=3)
    with pytest.raises(MeshError, match="neither"):
        extract_mesh(never, never)


@pytest.mark.parametrize("colors", [lambda p: p[:, :1], lambda p: np.full_like(p, np.nan)])
def test_colors_that_are_none_are_refused(colors) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(FieldNotFinite, match="colours"):
        colors_from(colors, np.zeros((3, 3)))

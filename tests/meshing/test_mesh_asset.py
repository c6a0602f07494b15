"""The whole way, from a field and some views to a coloured mesh."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.meshing import BadBudget, FieldNotFinite, Look, MeshError, Views, cast, colors_from, extract_mesh, vertex_normals
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
    seen = cast(made.mesh, origins, directions).hit
    assert (seen & (opacity > 0.5)).sum() / (seen | (opacity > 0.5)).sum() > 0.95
    assert made.extracted.faces > made.report.faces and made.extracted.watertight


def test_colors_are_asked_below_the_surface() -> None:
    made = extract_mesh(sphere, stripes, level=0.0, resolution=64, faces=4000)
    assert made.agreement is None and made.mesh.colors is not None
    np.testing.assert_allclose(made.mesh.colors, np.abs(made.mesh.vertices), atol=0.03)
    normals = vertex_normals(made.mesh)
    assert (normals * made.mesh.vertices / 0.6).sum(axis=1).min() > 0.99


@pytest.mark.parametrize("samples", [1, 8])
def test_every_point_is_counted_once_whatever_it_was_asked_for(samples: int) -> None:
    asked: list[np.ndarray] = []
    told: list[int] = []

    def field(points: np.ndarray) -> np.ndarray:
        asked.append(points)
        return sphere(points)

    look = Look(samples=samples, density=lambda raw: np.maximum(raw, 0))
    made = extract_mesh(field, stripes, level=0.0, resolution=16, faces=200, look=look, batch=1000, progress=told.append)
    assert told == sorted(set(told)) and made.asked == told[-1] and len(told) == len(asked)
    # Only the last batch of a question is padded: by its last point.
    padding = sum(int((points == points[-1]).all(axis=1).sum()) - 1 for points in asked)
    assert made.asked == sum(len(points) for points in asked) - padding


def test_bad_settings_are_refused_before_the_field_is_asked() -> None:
    def never(points: np.ndarray) -> np.ndarray:
        raise AssertionError("asked")

    with pytest.raises(BadBudget):
        extract_mesh(never, never, level=0.0, faces=3)
    with pytest.raises(MeshError, match="neither"):
        extract_mesh(never, never)


@pytest.mark.parametrize(
    ("colors", "told"),
    [
        (lambda p: p[:, :1], "a colour a point"),
        (lambda p: np.full_like(p, np.nan), "got 3 that are not of 3:"),
        (lambda p: np.where(np.arange(len(p))[:, None] == 1, np.inf, p), "got 1 that are not of 3:"),
    ],
)
def test_colors_that_are_none_are_refused(colors, told: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(FieldNotFinite, match=told):
        colors_from(colors, np.zeros((3, 3)))

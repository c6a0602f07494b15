"""Signed distances, the densities that follow from them, and raw values from logarithms, against their formulas in float64."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import SignedDistanceConfig
from dreamfields_core.fields import Field, build_field
from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.fields.rectified import log_of_raw, raw_of_log
from dreamfields_core.fields.signed_distance import eikonal_loss, log_laplace_density
from dreamfields_core.meshing import isosurface
from dreamfields_core.types import Array, Params
from tests.fields import twins

pytestmark = pytest.mark.usefixtures("strict_dtypes")

raw_and_slope = jax.jit(jax.vmap(jax.value_and_grad(raw_of_log)))
laplace_and_slopes = jax.jit(jax.vmap(jax.value_and_grad(log_laplace_density, argnums=(0, 1))))


@settings(max_examples=60)
@given(log_density=st.floats(-30.0, 6.0))
def test_the_softplus_of_a_raw_value_is_the_density_that_it_was_made_of(log_density: float) -> None:
    raw = float(raw_of_log(jnp.float32(log_density)))
    x = math.exp(np.float32(log_density))
    assert raw == pytest.approx(x + math.log(-math.expm1(-x)), rel=2e-6, abs=2e-6)
    assert float(log_of_raw(jnp.float32(raw))) == pytest.approx(log_density, rel=2e-6, abs=3e-6)


def test_raw_values_are_numbers_with_slopes_wherever_densities_are() -> None:
    logs = np.float32([-1e30, -1e4, -100.0, -15.001, -15.0, -14.999, 0.0, 5.0, 50.0, 80.0, 1e30])
    raw, slope = raw_and_slope(jnp.asarray(logs))
    assert np.isfinite(raw).all() and np.isfinite(slope).all()
    # Straight below, as steep as the density above (d raw / d log = x e^x / (e^x - 1)), without a jump where the branches meet.
    np.testing.assert_allclose(raw[:5], logs[:5], rtol=1e-6)
    np.testing.assert_allclose(slope[:4], 1.0)
    np.testing.assert_allclose(slope[6:8], [x / -math.expm1(-x) for x in np.exp(np.float64(logs[6:8]))], rtol=1e-5)
    assert (np.diff(raw) >= 0).all()


@settings(max_examples=60)
@given(distance=st.floats(-3.0, 3.0), beta=st.floats(0.01, 2.0))
def test_density_is_laplaces_distribution_over_beta(distance: float, beta: float) -> None:
    exact = twins.laplace(-np.float64(np.float32(distance)), float(np.float32(beta))) / float(np.float32(beta))
    ours = float(log_laplace_density(jnp.float32(distance), jnp.float32(beta)))
    if exact > 0:
        # The ratio of distance and beta, up to 300, is rounded once.
        assert ours == pytest.approx(math.log(exact), rel=1e-6, abs=1e-6)


def test_far_away_and_at_the_surface_the_logarithm_is_straight_or_flat_and_never_breaks() -> None:
    distance = jnp.asarray([-1e4, -1.0, -1e-30, 0.0, 1e-30, 1.0, 1e4], jnp.float32)
    beta = jnp.full(7, 1e-3)
    log_density, (by_distance, by_beta) = laplace_and_slopes(distance, beta)
    for values in (log_density, by_distance, by_beta):
        assert np.isfinite(values).all()
    half = -math.log(2)
    np.testing.assert_allclose(log_density, np.log(1e3) + np.float64([0, 0, half, half, half, half - 1e3, half - 1e7]), rtol=1e-6)
    np.testing.assert_allclose(by_distance, [0, 0, -1e3, -1e3, -1e3, -1e3, -1e3], atol=1e-2)


@pytest.mark.parametrize(("steepness", "expected"), [(1.0, 0.0), (2.0, 1.0), (0.0, 1.0)])
def test_the_eikonal_loss_is_how_far_the_slope_is_from_one(steepness: float, expected: float) -> None:
    slopes = steepness * jnp.asarray([[1.0, 0.0, 0.0], [0.6, 0.0, 0.8]])
    loss, gradient = jax.value_and_grad(eikonal_loss)(slopes)
    assert float(loss) == pytest.approx(expected, abs=1e-5) and np.isfinite(gradient).all()


def unbent(config: SignedDistanceConfig) -> tuple[Field, Params]:
    """A new field whose network says nothing."""
    field = build_field(config, bound=1.0)
    params = field.init(jax.random.key(0))
    params["network"]["out"]["kernel"] = jnp.zeros_like(params["network"]["out"]["kernel"])
    return field, params


def test_a_new_signed_distance_is_a_ball_whose_normals_point_away_from_its_middle() -> None:
    field, params = unbent(SignedDistanceConfig(frequencies=3, width=4, bottleneck=4, blocks=1, radius=0.5, softness=0.05))
    directions = np.random.default_rng(0).normal(size=(8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    surface = jnp.asarray(0.5 * directions, jnp.float32)

    def density(scale: float) -> Array:
        return field.density(field.apply(params, points_as_gaussians(scale * surface))[0])

    beta = 0.05 + 1e-3
    np.testing.assert_allclose(density(1.0), 0.5 / beta, rtol=1e-4)
    np.testing.assert_allclose(density(1.4), 0.5 / beta * math.exp(-0.2 / beta), rtol=1e-4)
    np.testing.assert_allclose(density(0.2), (1 - 0.5 * math.exp(-0.4 / beta)) / beta, rtol=1e-3)
    np.testing.assert_allclose(field.normals(params, surface), directions, atol=1e-5)
    np.testing.assert_allclose(field.normals(params, 3.0 * surface), directions, atol=1e-5)
    assert float(field.penalty(jax.random.key(1), params)) < 1e-4


def test_the_mesh_of_a_signed_distance_lies_on_its_surface() -> None:
    field, params = unbent(SignedDistanceConfig(frequencies=3, width=4, bottleneck=4, blocks=1, radius=0.5, softness=0.05))
    ask = jax.jit(lambda points: field.apply(params, points_as_gaussians(points))[0])
    level = field.raw(0.5 / (0.05 + 1e-3))
    mesh = isosurface(lambda points: np.asarray(ask(jnp.asarray(points, jnp.float32))), level, resolution=16, batch=512)
    # The raw value bends at the surface, within a cell of 0.125: what is left of it after two steps of false position.
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.5, atol=2e-3)


def test_normals_are_unit_vectors_or_nothing_at_any_steepness() -> None:
    for steepness in (1e-30, 1.0, 1e30):

        def raw(prepared: Params, gaussians: object, steepness: float = steepness) -> tuple[Array, Array]:
            return -steepness * (gaussians.means @ jnp.asarray([0.6, 0.0, 0.8])), gaussians.means  # type: ignore[attr-defined]

        field = Field(jax.random.key, lambda p: p, raw, lambda key, p: jnp.zeros(()), 1.0)
        np.testing.assert_allclose(field.normals(None, jnp.zeros((2, 3))), [[0.6, 0.0, 0.8]] * 2, rtol=1e-6)
    flat = Field(jax.random.key, lambda p: p, lambda p, g: (jnp.zeros(2), g.means), lambda key, p: jnp.zeros(()), 1.0)
    np.testing.assert_array_equal(flat.normals(None, jnp.ones((2, 3))), 0.0)

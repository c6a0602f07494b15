"""Emission and absorption against a loop in float64, over everything a density can be."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.rendering.compositing import OPAQUE, composite, optical_depths, over, transmittance_before, weights_of
from dreamfields_core.types import Rendering
from tests import reference

pytestmark = pytest.mark.usefixtures("strict_dtypes")


@jax.jit
def ours(density: jax.Array, length: jax.Array, colors: jax.Array, distances: jax.Array) -> tuple[jax.Array, Rendering]:
    depths = optical_depths(density, length)
    return weights_of(depths), composite(depths, colors, distances)


def assert_matches(density: np.ndarray, length: np.ndarray, *, count: int) -> None:
    """One ray against the loop.

    The exponent is a float32 sum of `count` terms: where it matters (below 20) it is off by at most count x 6e-8 x 20, and in
    practice by the square root of that count; the pixel's values by as much.
    """
    rng = np.random.default_rng(count)
    colors, distances = np.float32(rng.uniform(size=(count, 3))), np.float32(np.linspace(1, 5, count))
    density, length = np.float32(density), np.float32(length)
    weights, rendering = ours(*(jnp.asarray(value) for value in (density, length, colors, distances)))
    twin = reference.composite(*(np.float64(value) for value in (density, length, colors, distances)))
    close = 2e-7 * max(4.0, np.sqrt(count)) * 4
    np.testing.assert_allclose(weights, twin["weights"], atol=close)
    np.testing.assert_allclose(rendering.color, twin["color"], atol=close)
    np.testing.assert_allclose(rendering.transmittance, twin["transmittance"], atol=close)
    assert (np.asarray(weights) >= 0).all() and 0.0 <= float(rendering.transmittance) <= 1.0
    assert float(np.sum(np.float64(weights))) + float(rendering.transmittance) == pytest.approx(1.0, abs=close)
    if twin["opacity"] > 1e-6:
        assert float(rendering.depth) == pytest.approx(twin["depth"], rel=1e-4)


MAGNITUDES = st.one_of(st.just(0.0), st.just(np.inf), st.floats(-30, 30).map(lambda exponent: float(np.float32(10.0**exponent))))
LENGTHS = st.one_of(st.just(0.0), st.floats(-8, 4).map(lambda exponent: float(np.float32(10.0**exponent))))


@settings(max_examples=120)
@given(density=st.lists(MAGNITUDES, min_size=6, max_size=6), length=st.lists(LENGTHS, min_size=6, max_size=6))
def test_any_density_and_any_length(density: list, length: list) -> None:
    assert_matches(np.array(density), np.array(length), count=6)


@pytest.mark.parametrize("count", [1, 2, 64, 4096])
@pytest.mark.parametrize("depth", [1e-6, 1.0, 30.0])
def test_any_number_of_samples(count: int, depth: float) -> None:
    rng = np.random.default_rng(count)
    length = rng.uniform(0.5, 1.5, count) * 4.0 / count
    assert_matches(rng.uniform(size=count) * depth / 2.0, length, count=count)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), scale=st.floats(-8, 6))
def test_energy_is_conserved(seed: int, scale: float) -> None:
    """White light in front of a white wall is white, whatever stands there."""
    rng = np.random.default_rng(seed)
    density = np.float32(10.0**scale * rng.exponential(size=64))
    _, rendering = ours(jnp.asarray(density), jnp.full(64, 0.05), jnp.ones((64, 3)), jnp.arange(64.0))
    np.testing.assert_allclose(over(rendering, jnp.ones(3)), 1.0, atol=2e-6)


def test_a_thin_haze_keeps_its_digits() -> None:
    # 1 - exp(-x) would leave nothing of these.
    for tau in (1e-8, 1e-12, 1e-30):
        weights = weights_of(jnp.full(4, tau))
        np.testing.assert_allclose(weights, tau, rtol=1e-6)


def test_transmittance_before_starts_at_one_and_never_grows() -> None:
    before = np.asarray(transmittance_before(jnp.asarray(np.random.default_rng(0).exponential(size=(5, 30)), jnp.float32)))
    np.testing.assert_array_equal(before[:, 0], 1.0)
    assert (np.diff(before, axis=1) <= 0).all() and (before >= 0).all()


def test_nothing_and_everything_are_exact() -> None:
    _, empty = ours(jnp.zeros(8), jnp.ones(8), jnp.ones((8, 3)), jnp.ones(8))
    assert float(empty.transmittance) == 1.0 and float(empty.depth) == 0.0
    np.testing.assert_array_equal(empty.color, 0.0)
    _, wall = ours(jnp.full(8, jnp.inf), jnp.full(8, 1e-6), jnp.full((8, 3), 0.25), jnp.arange(8.0) + 2.0)
    assert float(wall.transmittance) == 0.0 and float(wall.depth) == 2.0
    np.testing.assert_array_equal(wall.color, 0.25)


def test_no_length_means_no_depth_however_dense() -> None:
    depths = optical_depths(jnp.array([jnp.inf, 1e30, 1.0, jnp.inf]), jnp.array([0.0, 0.0, 0.5, 1e-3]))
    np.testing.assert_array_equal(depths, [0.0, 0.0, 0.5, OPAQUE])


GRADIENT_CASES = {
    "thin": np.array([1e-3, 2e-3, 5e-4, 1e-3]),
    "half": np.array([0.3, 1.0, 0.2, 0.6]),
    "thick": np.array([3.0, 8.0, 2.0, 5.0]),
    "with nothing": np.array([0.0, 0.7, 0.0, 0.4]),
}


@pytest.mark.parametrize("name", GRADIENT_CASES)
def test_gradients_against_finite_differences_and_the_formulas(name: str) -> None:
    density = GRADIENT_CASES[name]
    rng = np.random.default_rng(0)
    length, distances, colors = np.full(4, 0.9), np.arange(1.0, 5.0), rng.uniform(size=(4, 3))
    mix = rng.normal(size=3)

    def single(values: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        _, rendering = ours(values, *(jnp.asarray(value, jnp.float32) for value in (length, colors, distances)))
        return rendering.transmittance, rendering.color @ jnp.asarray(mix, jnp.float32), rendering.depth

    slopes = [np.asarray(slope) for slope in jax.jit(jax.jacrev(single))(jnp.asarray(density, jnp.float32))]

    def twin(which: str) -> np.ndarray:
        def value(x: np.ndarray) -> float:
            out = reference.composite(x, length, colors, distances)
            return float(mix @ out[which]) if which == "color" else float(out[which])

        return np.array([reference.slope(value, density, axis) for axis in np.eye(4)])

    # Bounds: float32 rounding of terms of size 1; the depth divides by opacity, which magnifies it in thin haze.
    np.testing.assert_allclose(slopes[0], twin("transmittance"), atol=1e-6)
    np.testing.assert_allclose(slopes[1], twin("color"), atol=2e-6)
    np.testing.assert_allclose(slopes[2], twin("depth"), rtol=1e-3, atol=1e-5)
    # dT / d tau_i = -T, and dC / d tau_i = T_(i+1) c_i - what is seen behind i.
    exact = reference.composite(density, length, colors, distances)
    np.testing.assert_allclose(slopes[0], -exact["transmittance"] * length, atol=1e-6)
    behind = [sum(exact["weights"][j] * (colors[j] @ mix) for j in range(i + 1, 4)) for i in range(4)]
    after = [np.exp(-np.sum(density[: i + 1] * length[: i + 1])) for i in range(4)]
    formula = [length[i] * (after[i] * (colors[i] @ mix) - behind[i]) for i in range(4)]
    np.testing.assert_allclose(slopes[1], formula, atol=2e-6)


@settings(max_examples=40)
@given(density=st.lists(MAGNITUDES, min_size=5, max_size=5), length=st.lists(LENGTHS, min_size=5, max_size=5))
def test_no_gradient_is_ever_nan(density: list, length: list) -> None:
    slopes = slopes_of(*(jnp.asarray(value, jnp.float32) for value in (density, length)))
    assert all(np.isfinite(slope).all() for slope in slopes)


@jax.jit
def slopes_of(density: jax.Array, length: jax.Array) -> tuple[jax.Array, jax.Array]:
    def total(density: jax.Array, length: jax.Array) -> jax.Array:
        _, rendering = ours(density, length, jnp.full((5, 3), 0.5), jnp.arange(5.0))
        return jnp.sum(rendering.color) + rendering.transmittance + rendering.depth

    return jax.grad(total, argnums=(0, 1))(density, length)


def test_over_is_premultiplied() -> None:
    rendering = Rendering(color=jnp.array([[0.2, 0.1, 0.0]]), transmittance=jnp.array([0.5]), depth=jnp.zeros(1))
    np.testing.assert_allclose(over(rendering, jnp.array([[1.0, 0.5, 0.2]])), [[0.7, 0.35, 0.1]], rtol=1e-6)


@pytest.mark.parametrize("shape", [(0, 3), (1, 1), (2, 4, 3)])
def test_shapes(shape: tuple) -> None:
    rendering = composite(jnp.ones(shape), jnp.ones((*shape, 3)), jnp.ones(shape))
    assert rendering.transmittance.shape == rendering.depth.shape == shape[:-1] and rendering.color.shape == (*shape[:-1], 3)

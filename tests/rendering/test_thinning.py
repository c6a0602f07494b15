"""The thinned gradient: the values untouched, the same in expectation, few samples kept, and what went wrong still seen."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from dreamfields_core.rendering.packing import evaluate_packed
from dreamfields_core.rendering.thinning import probabilities, thin_gradient
from dreamfields_core.types import Gaussians

SLOPES = np.random.default_rng(0).normal(size=(6, 5, 4)).astype(np.float32) * 10.0 ** np.random.default_rng(1).uniform(-3, 0, (6, 5, 1))
"""Raw and colour slopes of 6 x 5 samples, of very different sizes."""


def thinned(key: jax.Array, learn: float, slopes: np.ndarray = SLOPES) -> jax.Array:
    """What is left of the slopes [R, S, 4]."""
    pull = jnp.asarray(slopes, jnp.float32)

    def loss(raw: jax.Array, color: jax.Array) -> jax.Array:
        raw, color = thin_gradient(key, raw, color, learn=learn)
        return jnp.sum(raw * pull[..., 0]) + jnp.sum(color * pull[..., 1:])

    raw, color = jax.grad(loss, argnums=(0, 1))(jnp.zeros(pull.shape[:2]), jnp.zeros((*pull.shape[:2], 3)))
    return jnp.concatenate([raw[..., None], color], axis=-1)


def probabilities_in_float64(sizes: np.ndarray, learn: float) -> np.ndarray:
    sizes = sizes.astype(np.float64)
    cut = sizes.sum() / max(learn * (sizes > 0).sum(), 1.0)
    return np.minimum(1.0, sizes / cut) if cut > 0 else np.zeros_like(sizes)


def test_values_pass_as_they_are() -> None:
    raw, color = jnp.asarray(SLOPES[..., 0]), jnp.asarray(SLOPES[..., 1:])
    same = thin_gradient(jax.random.key(0), raw, color, learn=0.1)
    np.testing.assert_array_equal(same[0], raw)
    np.testing.assert_array_equal(same[1], color)


def test_learning_from_all_leaves_the_gradient_alone() -> None:
    np.testing.assert_array_equal(thinned(jax.random.key(0), 1.0), SLOPES.astype(np.float32))


def test_the_expected_gradient_is_the_whole_one() -> None:
    rounds = 4000
    drawn = np.asarray(jax.vmap(lambda key: thinned(key, 0.3))(jax.random.split(jax.random.key(1), rounds)), np.float64)
    chance = probabilities_in_float64(np.abs(SLOPES).sum(-1), 0.3)[..., None]
    # Kept with probability p and divided by it: variance s^2 (1 - p) / p. Five standard errors over 120 numbers.
    allowed = 5 * np.abs(SLOPES) * np.sqrt((1 - chance) / chance / rounds) + 1e-6
    assert np.all(np.abs(drawn.mean(0) - SLOPES) < allowed)
    assert np.mean(np.any(drawn != 0, axis=-1)) < 0.31


SIZES = arrays.arrays(np.float32, st.integers(0, 30), elements=st.floats(0, 2.0**60, width=32, allow_subnormal=False))


@given(sizes=SIZES, learn=st.floats(0.01, 1.0))
def test_probabilities_are_those_of_float64_and_few_on_average(sizes: np.ndarray, learn: float) -> None:
    found = np.asarray(probabilities(jnp.asarray(sizes), learn=learn))
    assert np.all((found >= 0) & (found <= 1)) and np.all(found[sizes == 0] == 0)
    # Two sums and a division in float32; one sample may always be kept.
    np.testing.assert_allclose(found, probabilities_in_float64(sizes, learn), rtol=1e-5, atol=1e-30)
    assert found.sum() <= max(learn * (sizes > 0).sum(), 1.0) * (1 + 1e-5)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_number_stays_in_sight(bad: float) -> None:
    slopes = np.array(SLOPES)
    slopes[2, 3, 1] = bad
    for seed in range(5):
        left = np.asarray(thinned(jax.random.key(seed), 0.05, slopes))
        assert not np.isfinite(left[2, 3, 1])
        assert np.isfinite(np.delete(left.reshape(-1), (2 * 5 + 3) * 4 + 1)).all()


@pytest.mark.parametrize("size", [0.0, 2e-38, 3e38])
def test_sizes_at_the_ends_of_float32_do_no_harm(size: float) -> None:
    """Nothing at all, the least that is told from nothing, and sums that are infinite."""
    left = np.asarray(thinned(jax.random.key(0), 0.5, np.full((2, 3, 4), size, np.float32) * np.array([1, 0, 0, 0], np.float32)))
    assert np.isfinite(left[..., 1:]).all() and not np.isnan(left).any()
    assert (left[..., 0] != 0).any() == (size > 0)


def test_samples_without_a_slope_are_not_evaluated_again() -> None:
    """The packed evaluation's gradient asks the field only where the loss depends on what it said."""
    asked = []

    def spy(params: jax.Array, gaussians: Gaussians) -> tuple[jax.Array, jax.Array]:
        jax.debug.callback(lambda means: asked.append(np.asarray(means[:, 0])), gaussians.means)
        raw = params * gaussians.means[:, 0]
        return raw, jnp.tile(raw[:, None], (1, 3))

    def at(points: jax.Array, index: jax.Array) -> Gaussians:
        means = points[index]
        return Gaussians(means, means, means[:, 0], means[:, 0])

    points, mask = jnp.tile(jnp.arange(8.0)[:, None], (1, 3)), jnp.asarray([False, True, True, True, False, True, True, True])
    pull = jnp.asarray([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0])

    def loss(params: jax.Array) -> jax.Array:
        return jnp.sum(pull * evaluate_packed(spy, at, 2, params, points, mask)[0])

    gradient = jax.block_until_ready(jax.grad(loss)(jnp.ones(())))
    jax.effects_barrier()
    assert float(gradient) == 1.0 * 2 + 2.0 * 6
    assert [set(chunk) for chunk in asked] == [{1.0, 2.0}, {3.0, 5.0}, {6.0, 7.0}, {2.0, 6.0}]

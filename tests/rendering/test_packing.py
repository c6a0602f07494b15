"""Packed evaluation is the dense one under its mask, value and gradient, whatever the mask and the chunk."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.rendering.packing import evaluate_packed
from dreamfields_core.types import Gaussians


def at(samples: jax.Array, index: jax.Array) -> Gaussians:
    means = samples[index]
    return Gaussians(means, means, means[:, 0], means[:, 0])


def apply(params: dict, gaussians: Gaussians) -> tuple[jax.Array, jax.Array]:
    hidden = jnp.tanh(gaussians.means @ params["kernel"])
    return hidden[:, 0], jax.nn.sigmoid(hidden[:, 1:])


PARAMS = {"kernel": jnp.asarray(np.random.default_rng(0).normal(size=(3, 4)), jnp.float32)}
MASKS = {
    "empty": lambda rng, count: np.zeros(count, bool),
    "full": lambda rng, count: np.ones(count, bool),
    "random": lambda rng, count: rng.uniform(size=count) < 0.4,
    "only the last": lambda rng, count: np.arange(count) == count - 1,
    "only the first": lambda rng, count: np.arange(count) == 0,
}


def dense(params: dict, points: jax.Array, mask: jax.Array) -> tuple[jax.Array, jax.Array]:
    raw, color = apply(params, at(points, jnp.arange(points.shape[0])))
    return jnp.where(mask, raw, 0.0), jnp.where(mask[:, None], color, 0.0)


@pytest.mark.parametrize(("count", "chunk"), [(0, 4), (1, 1), (1, 8), (12, 4), (13, 4), (13, 64), (13, 1)])
def test_as_the_dense_evaluation(count: int, chunk: int) -> None:
    rng = np.random.default_rng(count)
    points = jnp.asarray(rng.normal(size=(count, 3)), jnp.float32)
    pull = jnp.asarray(rng.normal(size=(count, 4)), jnp.float32)

    def both(evaluate: object, mask: jax.Array) -> tuple:
        def total(params: dict) -> tuple:
            raw, color = evaluate(params, mask)
            return jnp.sum(pull * jnp.concatenate([raw[:, None], color], axis=1)), (raw, color)

        gradient, values = jax.grad(total, has_aux=True)(PARAMS)
        return values, gradient["kernel"]

    packed = jax.jit(lambda mask: both(lambda params, mask: evaluate_packed(apply, at, chunk, params, points, mask), mask))
    plain = jax.jit(lambda mask: both(lambda params, mask: dense(params, points, mask), mask))
    for name, make in MASKS.items():
        mask = jnp.asarray(make(rng, count))
        (values, gradient), (expected, expected_gradient) = packed(mask), plain(mask)
        for one, other in zip(values, expected, strict=True):
            assert one.shape == other.shape
            # The same sums in another order at most: products of 3 terms near 1.
            np.testing.assert_allclose(one, other, atol=3e-7, err_msg=name)
        np.testing.assert_allclose(gradient, expected_gradient, atol=3e-6, err_msg=name)


def test_only_the_kept_samples_are_asked_for() -> None:
    asked = []

    def spy(params: dict, gaussians: Gaussians) -> tuple[jax.Array, jax.Array]:
        jax.debug.callback(lambda means: asked.append(np.asarray(means[:, 0])), gaussians.means)
        return apply(params, gaussians)

    points = jnp.tile(jnp.arange(10.0)[:, None], (1, 3))
    mask = np.zeros(10, bool)
    mask[[2, 5, 6, 9]] = True
    jax.block_until_ready(evaluate_packed(spy, at, 3, PARAMS, points, jnp.asarray(mask)))
    jax.effects_barrier()
    assert len(asked) == 2 and set(np.concatenate(asked)) == {2.0, 5.0, 6.0, 9.0}


def test_a_gradient_that_is_not_finite_where_nothing_is_kept_stays_out() -> None:
    def poisonous(params: dict, gaussians: Gaussians) -> tuple[jax.Array, jax.Array]:
        # No slope at 0, where no kept sample is.
        raw = jnp.sqrt(params["kernel"][0, 0] ** 2 * gaussians.means[:, 0])
        return raw, jnp.tile(raw[:, None], (1, 3))

    points = jnp.asarray([[0.0] * 3, [4.0] * 3, [9.0] * 3, [0.0] * 3])
    mask = jnp.asarray([False, True, True, False])
    params = {"kernel": jnp.ones((3, 4))}
    gradient = jax.grad(lambda params: jnp.sum(evaluate_packed(poisonous, at, 8, params, points, mask)[0]))(params)
    assert float(gradient["kernel"][0, 0]) == pytest.approx(5.0)

"""Resizing against two trusted ones, and against its definition."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from dreamfields_core.guidance.resize import resize, weights


@pytest.mark.parametrize(("source", "target"), [(64, 48), (48, 64), (100, 48), (17, 5), (5, 17), (48, 48), (1, 4), (9, 1)])
def test_the_same_as_jax_and_pillow(source: int, target: int) -> None:
    image = np.random.default_rng(0).uniform(size=(source, source, 3)).astype(np.float32)
    ours = np.asarray(resize(jnp.asarray(image)[None], target))[0]
    theirs = jax.image.resize(jnp.asarray(image), (target, target, 3), "bilinear", antialias=True)
    np.testing.assert_allclose(ours, theirs, atol=2e-6)
    pillow = np.asarray(Image.fromarray(image[..., 0], "F").resize((target, target), Image.Resampling.BILINEAR))
    np.testing.assert_allclose(ours[..., 0], pillow, atol=2e-6)


def test_against_a_slow_float64_twin() -> None:
    image = np.random.default_rng(1).uniform(size=(7, 10))
    slow = np.zeros((4, 4))
    for i in range(4):
        for j in range(4):
            total = 0.0
            for h in range(7):
                for w in range(10):
                    share = max(0.0, 1 - abs((i + 0.5) * 7 / 4 - 0.5 - h) / (7 / 4)) * max(0.0, 1 - abs((j + 0.5) * 2.5 - 0.5 - w) / 2.5)
                    slow[i, j] += share * image[h, w]
                    total += share
            slow[i, j] /= total
    ours = resize(jnp.asarray(image, jnp.float32)[None, :, :, None], 4)[0, :, :, 0]
    np.testing.assert_allclose(ours, slow, atol=1e-6)


def test_one_colour_stays_that_colour_and_every_pixel_counts() -> None:
    np.testing.assert_allclose(resize(jnp.full((1, 50, 30, 3), 0.3), 16), 0.3, atol=1e-6)
    assert (weights(100, 7).sum(0) > 0).all()


def test_the_gradient_is_the_transpose() -> None:
    images = jnp.zeros((1, 9, 9, 1))
    slope = jax.grad(lambda x: resize(x, 4)[0, 1, 2, 0])(images)[0, :, :, 0]
    np.testing.assert_allclose(slope, np.outer(weights(9, 4)[1], weights(9, 4)[2]), atol=1e-6)


def test_an_empty_batch_and_a_missing_axis() -> None:
    assert resize(jnp.zeros((0, 9, 9, 3)), 4).shape == (0, 4, 4, 3)
    with pytest.raises(ValueError, match="add the batch axis"):
        resize(jnp.zeros((9, 9, 3)), 4)

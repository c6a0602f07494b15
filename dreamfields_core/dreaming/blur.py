"""Gaussian blur of a picture [H, W, C] with a width that is only known while running."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array

REACH = 7
"""Pixels to either side that a blurred pixel is made of; 15 taps in all, as in the released program."""


def blur_matrix(size: int, deviation: Array) -> Array:
    """[size, size] rows of weights that add up to 1; near the border the missing neighbours are left out.

    The identity for deviation 0: guarded before the division, so that the gradient is finite too.
    """
    deviation = in_float32(deviation)
    distance = jnp.abs(jnp.arange(size)[:, None] - jnp.arange(size)[None, :])
    blurred = deviation > 1e-3
    weights = jnp.exp(-0.5 * (distance / jnp.where(blurred, deviation, 1.0)) ** 2)
    weights = jnp.where(blurred, weights, (distance == 0).astype(weights.dtype))
    weights = jnp.where(distance <= REACH, weights, 0.0)
    return weights / jnp.sum(weights, axis=1, keepdims=True)


def gaussian_blur(picture: Array, deviation: Array) -> Array:
    """Rows, then columns. deviation: [] pixels, >= 0."""
    picture = in_float32(picture)
    rows, columns = blur_matrix(picture.shape[0], deviation), blur_matrix(picture.shape[1], deviation)
    return jnp.einsum("hi,wj,ijc->hwc", rows, columns, picture, precision=jax.lax.Precision.HIGHEST)

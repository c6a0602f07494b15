"""Gaussian blur of a picture [H, W, C] with a width that is only known while running."""

from __future__ import annotations

import jax.numpy as jnp

from dreamfields_core.types import Array

TAPS = 15


def gaussian_kernel(deviation: Array) -> Array:
    """[TAPS] weights that add up to 1; the identity for deviation 0 (guarded before the division, so the gradient is finite)."""
    place = jnp.arange(TAPS) - TAPS // 2
    blurred = deviation > 1e-3
    exponent = -0.5 * (place / jnp.where(blurred, deviation, 1.0)) ** 2
    weights = jnp.where(blurred, jnp.exp(exponent), (place == 0).astype(exponent.dtype))
    return weights / jnp.sum(weights)


def gaussian_blur(picture: Array, deviation: Array) -> Array:
    """Rows, then columns; the border is continued by its own pixels. deviation: [] pixels, >= 0."""
    kernel = gaussian_kernel(deviation)
    return _along(_along(picture, kernel, axis=0), kernel, axis=1)


def _along(picture: Array, kernel: Array, *, axis: int) -> Array:
    margin = [(0, 0)] * picture.ndim
    margin[axis] = (TAPS // 2, TAPS // 2)
    padded = jnp.pad(picture, margin, mode="edge")
    size = picture.shape[axis]
    shifted = [jnp.take(padded, jnp.arange(size) + tap, axis=axis) * kernel[tap] for tap in range(TAPS)]
    return sum(shifted[1:], start=shifted[0])

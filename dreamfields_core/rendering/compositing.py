"""Emission and absorption along a ray (paper equations 1 to 4).

Symbols: tau_i optical depth of piece i, density times length; T_i transmittance in front of it; w_i the share of the pixel
that it colours. Transmittance is the exponential of a sum, never a product of differences, and opacity -expm1(-tau): both
keep all digits when tau is tiny.
"""

from __future__ import annotations

import jax.numpy as jnp

from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Rendering

OPAQUE = 1e4
"""Optical depth from which exp(-tau) is exactly 0 in float32, by far; larger ones are cut here so that no infinity arises."""

SMALLEST_OPACITY = 1e-6
"""Opacity below which an expected depth means nothing."""


def optical_depths(density: Array, length: Array) -> Array:
    """tau = density x length [...], in [0, OPAQUE]; 0 where the length is 0, however large the density."""
    density, length = in_float32((density, length))
    # Finite before the product: infinity times the zero gradient of the cut would be NaN.
    density = jnp.minimum(jnp.where(length > 0, density, 0.0), jnp.finfo(density.dtype).max)
    return jnp.minimum(density * length, OPAQUE)


def transmittance_before(depths: Array) -> Array:
    """T_i = exp(-sum of tau_j over j < i) along the last axis; [..., S], the first one 1."""
    depths = in_float32(depths)
    summed = jnp.cumsum(depths[..., :-1], axis=-1)
    return jnp.exp(-jnp.concatenate([jnp.zeros_like(depths[..., :1]), summed], axis=-1))


def weights_of(depths: Array) -> Array:
    """w_i = T_i (1 - exp(-tau_i)), paper equation 3; [..., S], in [0, 1], their sum at most 1."""
    depths = in_float32(depths)
    return transmittance_before(depths) * -jnp.expm1(-depths)


def composite(depths: Array, colors: Array, distances: Array) -> Rendering:
    """Collect the samples of each ray.

    Args:
      depths: [..., S] optical depth of each sample's piece.
      colors: [..., S, 3] in [0, 1].
      distances: [..., S] along the ray.

    Returns:
      Rendering of shape [...]; colour premultiplied, depth divided by opacity.
    """
    depths, colors, distances = in_float32((depths, colors, distances))
    weights = weights_of(depths)
    opacity = jnp.sum(weights, axis=-1)
    return Rendering(
        color=jnp.sum(weights[..., None] * colors, axis=-2),
        transmittance=jnp.exp(-jnp.sum(depths, axis=-1)),
        depth=jnp.sum(weights * distances, axis=-1) / jnp.maximum(opacity, SMALLEST_OPACITY),
    )


def over(rendering: Rendering, background: Array) -> Array:
    """Stand a rendering on a background [..., 3]: premultiplied over; [..., 3]."""
    return rendering.color + rendering.transmittance[..., None] * background

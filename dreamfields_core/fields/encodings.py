"""Positional encodings, along the axes or in random directions, at a point or over a sample's footprint (paper section 3.1).

Symbols: omega [F, 3] angular frequencies; mu, Sigma mean and covariance of a sample's Gaussian; d its ray's unit direction;
t_var, r_var its variance along and across the ray.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.config import EncodingConfig
from dreamfields_core.fields.waves import sine_cosine
from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Gaussians


def sample_frequencies(key: Array, count: int, *, levels: float) -> Array:
    """Paper equation 6: omega = 2^u d, u uniform on [0, levels], d uniform on the sphere. Returns [count, 3]."""
    level_key, direction_key = jax.random.split(key)
    direction = jax.random.normal(direction_key, (count, 3))
    direction = direction / jnp.linalg.norm(direction, axis=-1, keepdims=True)
    return 2.0 ** jax.random.uniform(level_key, (count, 1), maxval=levels) * direction


def axis_frequencies(levels: int) -> Array:
    """NeRF equation 4, and the paper's section 3.1: omega = 2^l e along each axis e, l = 0 ... levels - 1. Returns [3 levels, 3]."""
    return jnp.concatenate([2.0**level * jnp.eye(3) for level in range(levels)])


def initial_frequencies(key: Array, config: EncodingConfig) -> Array:
    """The frequencies that a network starts with, and keeps; [F, 3]."""
    if config.fourier:
        return sample_frequencies(key, config.frequencies, levels=config.levels)
    return axis_frequencies(round(config.levels))


def encoding_size(config: EncodingConfig) -> int:
    """Numbers that come out of `encode`."""
    return 3 + 2 * (config.frequencies if config.fourier else 3 * round(config.levels))


def encode(frequencies: Array, gaussians: Gaussians, *, integrated: bool) -> Array:
    """The encoding of every sample, [N, 3 + 2 F].

    The frequencies travel with the parameters but stay as drawn: no gradient, so Adam never moves them.
    """
    frequencies = jax.lax.stop_gradient(frequencies)
    return integrated_encoding(frequencies, gaussians) if integrated else point_encoding(frequencies, gaussians.means)


def projected_variance(frequencies: Array, gaussians: Gaussians) -> Array:
    """omega^T Sigma omega for every sample and frequency, [N, F].

    Sigma = t_var d d^T + r_var (I - d d^T), so two projections say it all and no 3 x 3 matrix is formed.
    """
    along = jnp.matmul(gaussians.directions, frequencies.T, precision=jax.lax.Precision.HIGHEST) ** 2
    whole = jnp.sum(frequencies**2, axis=-1)[None, :]
    across = jnp.maximum(whole - along, 0.0)
    return gaussians.along[:, None] * along + gaussians.across[:, None] * across


def point_encoding(frequencies: Array, points: Array) -> Array:
    """The position and sin(omega x), cos(omega x) at points [N, 3] (NeRF equation 4); [N, 3 + 2 F]."""
    frequencies, points = in_float32((frequencies, points))
    phase = jnp.matmul(points, frequencies.T, precision=jax.lax.Precision.HIGHEST)
    return jnp.concatenate([points, *sine_cosine(phase)], axis=-1)


def integrated_encoding(frequencies: Array, gaussians: Gaussians) -> Array:
    """E[sin(omega x)], E[cos(omega x)] over the sample's Gaussian (mip-NeRF equation 14), after the position itself.

    Returns [N, 3 + 2 F].
    """
    frequencies, gaussians = in_float32((frequencies, gaussians))
    phase = jnp.matmul(gaussians.means, frequencies.T, precision=jax.lax.Precision.HIGHEST)
    damping = jnp.exp(-0.5 * projected_variance(frequencies, gaussians))
    sine, cosine = sine_cosine(phase)
    return jnp.concatenate([gaussians.means, damping * sine, damping * cosine], axis=-1)

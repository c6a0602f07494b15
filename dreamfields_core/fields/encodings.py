"""Positional encoding with random frequencies, integrated over the footprint of a sample (paper section 3.1).

Symbols: omega [F, 3] angular frequencies; mu, Sigma mean and covariance of a sample's Gaussian; d its ray's unit direction;
t_var, r_var its variance along and across the ray.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array, Gaussians


def sample_frequencies(key: Array, count: int, *, levels: float) -> Array:
    """Paper equation 4: omega = 2^u d, u uniform on [0, levels], d uniform on the sphere. Returns [count, 3]."""
    level_key, direction_key = jax.random.split(key)
    direction = jax.random.normal(direction_key, (count, 3))
    direction = direction / jnp.linalg.norm(direction, axis=-1, keepdims=True)
    return 2.0 ** jax.random.uniform(level_key, (count, 1), maxval=levels) * direction


def projected_variance(frequencies: Array, gaussians: Gaussians) -> Array:
    """omega^T Sigma omega for every sample and frequency, [N, F].

    Sigma = t_var d d^T + r_var (I - d d^T), so two projections say it all and no 3 x 3 matrix is formed.
    """
    along = jnp.matmul(gaussians.directions, frequencies.T, precision=jax.lax.Precision.HIGHEST) ** 2
    whole = jnp.sum(frequencies**2, axis=-1)[None, :]
    across = jnp.maximum(whole - along, 0.0)
    return gaussians.along[:, None] * along + gaussians.across[:, None] * across


def integrated_encoding(frequencies: Array, gaussians: Gaussians) -> Array:
    """E[sin(omega x)], E[cos(omega x)] over the sample's Gaussian (mip-NeRF equation 14), after the position itself.

    Returns [N, 3 + 2 F].
    """
    phase = jnp.matmul(gaussians.means, frequencies.T, precision=jax.lax.Precision.HIGHEST)
    damping = jnp.exp(-0.5 * projected_variance(frequencies, gaussians))
    return jnp.concatenate([gaussians.means, damping * jnp.sin(phase), damping * jnp.cos(phase)], axis=-1)

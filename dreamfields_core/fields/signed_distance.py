"""Density from a signed distance (paper appendix E; VolSDF, Yariv et al. 2021).

Symbols: d signed distance to the surface, negative inside; beta width of the surface; sigma = Psi_beta(-d) / beta the density, Psi the
distribution function of Laplace's distribution of scale beta.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike

from dreamfields_core.config import SignedDistanceConfig
from dreamfields_core.fields.contract import Field, points_as_gaussians
from dreamfields_core.fields.network import as_functions
from dreamfields_core.fields.rectified import raw_of_log
from dreamfields_core.fields.residual_mlp import ResidualMLP
from dreamfields_core.types import Array, Gaussians, Params

BEND = 0.1
"""World units by which the network moves the surface for each unit of its output: a new one hardly dents the ball."""

SHARPEST = 1e-3
"""beta stays above this, world units: a surface thinner than any sample would be missed by all of them."""

CENTER = 1e-6
"""Added to the squared radius of the ball, so that its slope at the centre is a number."""


def log_laplace_density(distance: Array, beta: Array) -> Array:
    """log of sigma = Psi_beta(-d) / beta (VolSDF equations 2 and 3, alpha = 1 / beta); [...].

    Far outside it is a straight line in the distance, where Psi itself underflows.
    """
    ratio = distance / beta
    outside = distance > 0
    # where before: the exponential of the branch that is not taken would overflow, and its slope be infinity times zero.
    inner = jnp.log1p(-0.5 * jnp.exp(jnp.where(outside, 0.0, ratio)))
    return jnp.where(outside, -math.log(2.0) - ratio, inner) - jnp.log(beta)


def eikonal_loss(slopes: Array) -> Array:
    """Mean of (|grad d| - 1)^2 over slopes [N, 3] (Gropp et al. 2020, equation 2): a distance changes by one a unit; []."""
    return jnp.mean((jnp.sqrt(jnp.sum(slopes**2, axis=-1) + 1e-12) - 1.0) ** 2)


def signed_distance(config: SignedDistanceConfig, *, bound: float, products: DTypeLike = jnp.float32) -> Field:
    """A ball, bent by the paper's network, as soft as it has learned to be."""
    fresh, ask = as_functions(lambda rngs: ResidualMLP(config, rngs, products=products))

    def init(key: Array) -> Params:
        return {"network": fresh(key), "log_beta": jnp.float32(math.log(config.softness))}

    def distance_and_colors(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        bend, colors = ask(prepared["network"], gaussians)
        ball = jnp.sqrt(jnp.sum(gaussians.means**2, axis=-1) + CENTER) - config.radius
        return ball + BEND * bend, colors

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        distance, colors = distance_and_colors(prepared, gaussians)
        return raw_of_log(log_laplace_density(distance, SHARPEST + jnp.exp(prepared["log_beta"]))), colors

    def penalty(key: Array, prepared: Params) -> Array:
        points = jax.random.uniform(key, (config.eikonal_points, 3), minval=-bound, maxval=bound)
        slopes = jax.grad(lambda places: jnp.sum(distance_and_colors(prepared, points_as_gaussians(places))[0]))(points)
        return config.eikonal * eikonal_loss(slopes)

    return Field(init=init, prepare=lambda params: params, apply=apply, penalty=penalty, density_scale=1.0)

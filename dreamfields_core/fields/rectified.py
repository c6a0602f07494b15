"""The raw value behind a density that is known by its logarithm: the inverse of the softplus, in log space.

A field that defines its density itself (by a signed distance, by a picture's opacity) gives this as its raw value. Far outside,
where density underflows, its logarithm is still a number with a slope, and the surface of a mesh is looked for in it.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array

TINY = -15.0
"""Below this log-density x, softplus(x) = exp(x) to the last digit of float32, so that raw and logarithm are one."""

HUGE = 80.0
"""Above this log-density float32 overflows; what is so dense is cut here."""


def raw_of_log(log_density: Array) -> Array:
    """raw [...] with softplus(raw) = exp(log_density): x + log(1 - exp(-x)) with x the density."""
    small = log_density < TINY
    # where before: the branch that is not taken must have a finite slope too.
    density = jnp.exp(jnp.where(small, 0.0, jnp.minimum(log_density, HUGE)))
    return jnp.where(small, log_density, density + jnp.log(-jnp.expm1(-density)))


def log_of_raw(raw: Array) -> Array:
    """log softplus(raw) [...], the inverse of `raw_of_log`; finite wherever raw is."""
    small = raw < TINY
    return jnp.where(small, raw, jnp.log(jax.nn.softplus(jnp.where(small, 0.0, raw))))

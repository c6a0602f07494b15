"""Where a ray crosses the cube that bounds the scene (paper section 4.6), by slabs."""

from __future__ import annotations

import jax.numpy as jnp

from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Rays

PARALLEL = 1e-12
"""A direction component below this moves a ray by less than float32 can tell anywhere near the cube."""


def ray_cube(rays: Rays, origin: Array, *, bound: float) -> tuple[Array, Array]:
    """Distances at which rays enter and leave the cube of half-side `bound` about `origin` [3].

    Returns:
      near, far: [...] each, 0 <= near <= far; near = far = 0 where the ray misses the cube or it lies behind.
    """
    rays, origin = in_float32((rays, origin))
    start = rays.origins - jnp.broadcast_to(origin, rays.origins.shape)
    parallel = jnp.abs(rays.directions) < PARALLEL
    # where before the division: a zero component would make 0 * inf on the slab, and NaN in the gradient even when unused.
    slope = 1.0 / jnp.where(parallel, 1.0, rays.directions)
    one, other = (-bound - start) * slope, (bound - start) * slope
    within = jnp.abs(start) <= bound
    enter = jnp.where(parallel, jnp.where(within, -jnp.inf, jnp.inf), jnp.minimum(one, other)).max(axis=-1)
    leave = jnp.where(parallel, jnp.where(within, jnp.inf, -jnp.inf), jnp.maximum(one, other)).min(axis=-1)
    enter = jnp.maximum(enter, 0.0)
    hit = leave > enter
    return jnp.where(hit, enter, 0.0), jnp.where(hit, leave, 0.0)

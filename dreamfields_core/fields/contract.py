"""What every field offers, whatever it is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array, Gaussians, Params


@dataclass(frozen=True)
class Field:
    """A radiance field as pure functions of its parameters. The paper's fields do not see the viewing direction.

    init: key -> params.
    prepare: params -> what `apply` reads, computed once a step (for instance one grid out of several); differentiable.
    apply: (prepared, gaussians [N]) -> raw density [N] (before its activation, any real number) and colour [N, 3] in [0, 1].
    penalty: (key, prepared) -> [] the field's own regulariser, already weighted; 0 for those that have none. The key is for those
      that look at themselves at random points.
    density_scale: density = density_scale * softplus(raw).
    """

    init: Callable[[Array], Params]
    prepare: Callable[[Params], Params]
    apply: Callable[[Params, Gaussians], tuple[Array, Array]]
    penalty: Callable[[Array, Params], Array]
    density_scale: float

    def density(self, raw: Array) -> Array:
        """Raw density [...] -> density [...] >= 0, in 1 / world unit."""
        return self.density_scale * jax.nn.softplus(raw)

    def raw(self, density: float) -> float:
        """The raw density at which `density` gives this value, > 0: log(expm1(x)), written so that large x do not overflow."""
        scaled = density / self.density_scale
        return float(scaled + jnp.log(-jnp.expm1(-jnp.float32(scaled))))

    def normals(self, prepared: Params, points: Array) -> Array:
        """Unit vectors [N, 3] out of what is dense, at points [N, 3]: down the slope of the raw density; 0 where it has none."""
        slopes = -jax.grad(lambda places: jnp.sum(self.apply(prepared, points_as_gaussians(places))[0]))(points)
        # Scaled before it is squared, so that neither the steepest nor the flattest slope leaves the range of float32.
        largest = jnp.max(jnp.abs(slopes), axis=-1, keepdims=True)
        scaled = slopes / jnp.where(largest > 0, largest, 1.0)
        return scaled / jnp.maximum(jnp.sqrt(jnp.sum(scaled**2, axis=-1, keepdims=True)), 1.0)


def points_as_gaussians(points: Array) -> Gaussians:
    """Points [N, 3] as Gaussians of no extent, for asking a field without a camera."""
    nothing = jnp.zeros(points.shape[:-1], points.dtype)
    return Gaussians(means=points, directions=jnp.zeros_like(points), along=nothing, across=nothing)

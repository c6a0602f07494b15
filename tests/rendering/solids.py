"""Fields whose every ray is known by formula."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.fields.contract import Field
from dreamfields_core.types import Array, Gaussians, Rays

COLOR = (0.9, 0.4, 0.1)


def ball(*, radius: float, softness: float = 0.0, centers: tuple = ((0.0, 0.0, 0.0),)) -> Field:
    """Balls of density `prepared["density"]`; the edge is a step, or a logistic curve of that width."""

    def apply(prepared: dict, gaussians: Gaussians) -> tuple[Array, Array]:
        gaps = [radius - jnp.linalg.norm(gaussians.means - jnp.asarray(center)[None, :], axis=-1) for center in centers]
        inside = jnp.stack(gaps).max(axis=0)
        share = jax.nn.sigmoid(inside / softness) if softness else (inside > 0).astype(jnp.float32)
        density = prepared["density"] * share + 1e-20
        return density + jnp.log(-jnp.expm1(-density)), jnp.tile(jnp.asarray(COLOR)[None, :], (gaussians.means.shape[0], 1))

    return Field(
        init=lambda key: {"density": jnp.ones(())},
        prepare=lambda params: params,
        apply=apply,
        penalty=lambda key, prepared: jnp.zeros(()),
        density_scale=1.0,
    )


def parallel_rays(side: int, *, reach: float = 0.9, distance: float = 3.0) -> Rays:
    """A grid of rays along x, [side^2], that never runs through a cell's or a ball's symmetric places."""
    places = (np.arange(side) + 0.437) / side * 2 * reach - reach
    y, z = np.meshgrid(places, places, indexing="ij")
    origins = np.stack([np.full(side**2, -distance), y.ravel(), z.ravel()], axis=1)
    directions = np.tile([[1.0, 0.0, 0.0]], (side**2, 1))
    return Rays(jnp.asarray(origins, jnp.float32), jnp.asarray(directions, jnp.float32), jnp.full((side**2, 1), 1e-3))

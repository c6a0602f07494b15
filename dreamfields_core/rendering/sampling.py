"""Where along a ray the field is asked.

Symbols: R rays, S samples a ray at most; step = 2 sqrt(3) bound / S, the same for all rays, so that a short chord through the
cube takes few samples and the longest, the diagonal, takes all; t distance along the ray.
"""

from __future__ import annotations

import math

import flax.struct
import jax.numpy as jnp

from dreamfields_core.precision import in_float32
from dreamfields_core.rendering.shares import Share, uniform
from dreamfields_core.scene.cube import ray_cube
from dreamfields_core.types import Array, Gaussians, Rays


@flax.struct.dataclass
class Samples:
    """Samples along R rays.

    rays: shape [R]. near: [R] where each chord starts. shift: [R, S] each sample's place within its step, in [0, 1).
    length: [R, S] of the piece of the chord that a sample stands for; 0 beyond the chord's end.
    step: [] length of a full piece.
    """

    rays: Rays
    near: Array
    shift: Array
    length: Array
    step: Array

    def distances(self) -> Array:
        """[R, S] distance of each sample along its ray."""
        return self.near[:, None] + (jnp.arange(self.shift.shape[1])[None, :] + self.shift) * self.step

    def points(self) -> Array:
        """[R, S, 3] position of each sample, world space."""
        return self.rays.origins[:, None] + self.distances()[..., None] * self.rays.directions[:, None]


def place_samples(key: Array | None, rays: Rays, origin: Array, *, bound: float, count: int, share: Share | None = None) -> Samples:
    """Samples at even steps through the cube about `origin` [3], jittered within their steps if a key is given.

    Args:
      key: None for samples in the middle of their steps.
      rays: shape [R].
      count: S, steps along the cube's diagonal.
      share: which rays of a picture these are; None means all.
    """
    rays, origin = in_float32((rays, origin))
    near, far = ray_cube(rays, origin, bound=bound)
    step = jnp.float32(step_length(bound=bound, count=count))
    begin = jnp.arange(count) * step
    length = jnp.clip((far - near)[:, None] - begin[None, :], 0.0, step)
    shape = (near.shape[0], count)
    shift = jnp.full(shape, 0.5) if key is None else uniform(key, shape, share)
    # The last piece of a chord is shorter than a step: its sample stays inside it.
    return Samples(rays=rays, near=near, shift=shift * (length / step), length=length, step=step)


def step_length(*, bound: float, count: int) -> float:
    """The cube's diagonal, cut into `count` steps; world units."""
    return 2.0 * math.sqrt(3.0) * bound / count


def gaussians_at(samples: Samples, index: Array) -> Gaussians:
    """The conical frustums of the samples with flat indices `index` [N] into [R, S], as Gaussians (mip-NeRF, equation 7).

    A frustum from t0 to t1 with middle c and half-width h; in the form that stays accurate when h << c, and by ratios, so that
    no power of a short distance underflows. The mean lies a little beyond the middle, because a cone widens.
    """
    ray, place = jnp.divmod(index, samples.shift.shape[1])
    half = 0.5 * samples.step
    middle = samples.near[ray] + (place + samples.shift[ray, place]) * samples.step
    middle_sq, half_sq = middle**2, half**2
    common = 3.0 * middle_sq + half_sq
    share = half_sq / common
    center = middle * (1.0 + 2.0 * share)
    along = half_sq * (1.0 / 3.0 - (4.0 / 15.0) * share * ((12.0 * middle_sq - half_sq) / common))
    across = samples.rays.radii[ray, 0] ** 2 * (0.25 * middle_sq + half_sq * (5.0 / 12.0 - (4.0 / 15.0) * share))
    directions = samples.rays.directions[ray]
    return Gaussians(
        means=samples.rays.origins[ray] + center[:, None] * directions,
        directions=directions,
        along=along,
        across=across,
    )

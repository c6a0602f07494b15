"""Rays in, what they see out: place samples, choose, evaluate, composite."""

from __future__ import annotations

import flax.struct
import jax
import jax.numpy as jnp

from dreamfields_core.config import SkipConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.rendering.compositing import composite, optical_depths
from dreamfields_core.rendering.occupancy import Occupancy
from dreamfields_core.rendering.packing import chunk_size, evaluate_packed
from dreamfields_core.rendering.sampling import gaussians_at, place_samples
from dreamfields_core.rendering.shares import Share
from dreamfields_core.rendering.skipping import choose_samples
from dreamfields_core.rendering.thinning import thin_gradient
from dreamfields_core.types import Array, Params, Rays, Rendering


@flax.struct.dataclass
class Tally:
    """What a rendering learned besides its pixels.

    evaluated: [] int32, samples that the field was asked for. possible: [] int32, what the dense path would have asked.
    mass: [] sum of the samples' opacities. moment: [3] sum of their positions times their opacities.
    """

    evaluated: Array
    possible: Array
    mass: Array
    moment: Array


def render_rays(
    key: Array | None,
    field: Field,
    prepared: Params,
    rays: Rays,
    origin: Array,
    occupancy: Occupancy,
    *,
    samples: int,
    bound: float,
    skip: SkipConfig,
    share: Share | None = None,
) -> tuple[Rendering, Tally]:
    """Render rays of shape [R]; differentiable in `prepared`.

    Args:
      key: jitters the samples and explores empty cells; None renders the same picture every time.
      origin: [3] centre of the cube outside of which density is zero.
      samples: steps along the cube's diagonal.
      share: which rays of a picture these are, where others are rendered elsewhere; None means all.

    Returns:
      Rendering of shape [R], and a Tally (which carries no gradient).
    """
    jitter_key, explore_key = (None, None) if key is None else jax.random.split(key)
    placed = place_samples(jitter_key, rays, origin, bound=bound, count=samples, share=share)
    kept, weight = choose_samples(explore_key, placed, origin, occupancy, bound=bound, skip=skip, share=share)
    raw, colors = evaluate_packed(field.apply, gaussians_at, chunk_size(skip.chunk), prepared, placed, kept.reshape(-1))
    raw, colors = raw.reshape(kept.shape), colors.reshape(*kept.shape, 3)
    if key is not None and skip.enabled:
        raw, colors = thin_gradient(jax.random.fold_in(key, 2), raw, colors, learn=skip.learn, share=share)
    depths = optical_depths(field.density(raw), jnp.where(kept, placed.length * weight, 0.0))
    rendering = composite(depths, colors, placed.distances())
    opacity = jax.lax.stop_gradient(-jnp.expm1(-depths))
    return rendering, Tally(
        evaluated=jnp.sum(kept, dtype=jnp.int32),
        possible=jnp.int32(kept.size),
        mass=jnp.sum(opacity),
        moment=jnp.einsum("rs,rsx->x", opacity, placed.points(), precision=jax.lax.Precision.HIGHEST),
    )

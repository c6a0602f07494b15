"""Learn from the samples that say most: the gradient runs through few of them, drawn so that its expectation stays the same.

Once a picture has been compared, the loss's slope in every sample's density and colour is known exactly and cheaply; what costs is
to carry the slopes into the field's parameters. Most of them are tiny: samples in thin haze, behind the surface, or of a pixel
that is as it should be. Each is kept with a probability that grows with its size, and what is kept is divided by that
probability ("Russian roulette", as in path tracing).

Symbols: s_i >= 0 size of sample i's slope; p_i = min(1, s_i / cut) its probability. The cut is the mean of the sizes above zero, divided by
the share that is learned from: no more than that share is kept on average, and slopes above the cut stay as they are.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.rendering.shares import Share, total, uniform
from dreamfields_core.types import Array


def thin_gradient(key: Array, raw: Array, color: Array, *, learn: float, share: Share | None = None) -> tuple[Array, Array]:
    """The field's values [R, S] and [R, S, 3] as they are; their gradient is zero but for a few samples, and the same in expectation.

    Args:
      learn: at most this share of the samples that have a slope is expected to keep one, in (0, 1]; 1 keeps all.
      share: which rays of a picture these are, where others are rendered elsewhere; None means all.
    """
    if learn >= 1:
        return raw, color
    return _thinned(key, learn, share, raw, color)


def probabilities(sizes: Array, *, learn: float, share: Share | None = None) -> Array:
    """p [...] in [0, 1]: 0 where there is no slope, 1 where it is no number, so that what has gone wrong stays in sight."""
    finite = jnp.isfinite(sizes)
    known = jnp.where(finite, sizes, 0.0)
    count = total(jnp.sum(known > 0, dtype=jnp.float32), share)
    cut = total(jnp.sum(known), share) / jnp.maximum(learn * count, 1.0)
    # Sizes so large that their sum is infinite, or so small that it is zero, are all kept.
    usable = jnp.isfinite(cut) & (cut > 0)
    drawn = jnp.where(usable, known / jnp.where(usable, cut, 1.0), jnp.sign(known))
    return jnp.where(finite, jnp.minimum(drawn, 1.0), 1.0)


@partial(jax.custom_vjp, nondiff_argnums=(1,))
def _thinned(key: Array, learn: float, share: Share | None, raw: Array, color: Array) -> tuple[Array, Array]:
    return raw, color


def _forward(key: Array, learn: float, share: Share | None, raw: Array, color: Array) -> tuple[tuple[Array, Array], Any]:
    return (raw, color), (key, share)


def _backward(learn: float, saved: Any, slopes: tuple[Array, Array]) -> tuple[Any, Any, Array, Array]:
    key, share = saved
    raw_slope, color_slope = slopes
    chance = probabilities(jnp.abs(raw_slope) + jnp.sum(jnp.abs(color_slope), axis=-1), learn=learn, share=share)
    kept = uniform(key, raw_slope.shape, share) < chance
    factor = jnp.where(kept, 1.0 / jnp.where(kept, chance, 1.0), 0.0)
    # Selected, not multiplied: a slope of a sample that is not kept may be anything.
    raw = jnp.where(kept, raw_slope * factor, 0.0)
    color = jnp.where(kept[..., None], color_slope * factor[..., None], 0.0)
    nothing = jax.tree.map(lambda leaf: np.zeros(leaf.shape, jax.dtypes.float0), (key, share))
    return *nothing, raw, color


_thinned.defvjp(_forward, _backward)

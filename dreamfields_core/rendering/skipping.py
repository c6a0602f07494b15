"""Which samples are worth asking the field for, and what the others stand for.

Empty cells are still explored: each of their samples is kept with probability `explore` and its optical depth divided by
`explore`, so that the expected optical depth of a ray, and its gradient, are those of evaluating everything.
"""

from __future__ import annotations

import math

import jax.numpy as jnp

from dreamfields_core.config import SkipConfig
from dreamfields_core.rendering.occupancy import DENSEST, Occupancy, cell_index, inner_density, occupied_cells
from dreamfields_core.rendering.sampling import Samples
from dreamfields_core.rendering.shares import Share, uniform
from dreamfields_core.types import Array


def choose_samples(
    key: Array | None,
    samples: Samples,
    origin: Array,
    occupancy: Occupancy,
    *,
    bound: float,
    skip: SkipConfig,
    share: Share | None = None,
) -> tuple[Array, Array]:
    """What to evaluate.

    Args:
      key: None leaves empty cells out altogether, for pictures that nothing is learned from.
      samples: [R, S].
      share: which rays of a picture these are; None means all.

    Returns:
      kept: [R, S] bool. weight: [R, S], by which a kept sample's optical depth is multiplied.
    """
    everything = jnp.ones(samples.length.shape, bool)
    if not skip.enabled:
        return everything, jnp.ones(samples.length.shape)
    inside = samples.length > 0
    cell = cell_index(samples.points(), origin, bound=bound, resolution=occupancy.resolution)
    filled = occupied_cells(occupancy, step=samples.step, threshold=skip.threshold).reshape(-1)[cell]
    kept = filled & ~_hidden(samples, inner_density(occupancy).reshape(-1)[cell], terminate=skip.terminate)
    weight = jnp.ones(samples.length.shape)
    if key is not None:
        explored = ~filled & (uniform(key, samples.length.shape, share) < skip.explore)
        kept = kept | explored
        weight = jnp.where(explored, 1.0 / skip.explore, weight)
    return kept & inside, weight


def _hidden(samples: Samples, density: Array, *, terminate: float) -> Array:
    """[R, S] behind what is opaque by the least density remembered around each sample.

    The memory is a running maximum over a whole cell, so it is believed only of cells whose neighbours are dense too, and
    there only half of it; the samples in the layer of cells under a surface are all evaluated.
    """
    if terminate <= 0:
        return jnp.zeros(samples.length.shape, bool)
    believed = 0.5 * jnp.minimum(density, DENSEST) * samples.length
    before = jnp.cumsum(believed, axis=-1) - believed
    return before > -math.log(terminate)

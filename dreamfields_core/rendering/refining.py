"""Pictures in two passes: a coarse one finds out where along each ray light is absorbed and still seen, and only there samples are fine.

For finished fields, without gradient. Symbols: K fine steps in a coarse one, S coarse steps along the cube's diagonal, tau and T as in
`compositing`. A coarse step that is not refined stands for its K pieces with the one value that it has, so the two passes make
one quadrature: the midpoint rule with steps that are short where the integrand is large.
"""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp

from dreamfields_core.config import SkipConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.rendering.compositing import composite, optical_depths, transmittance_before
from dreamfields_core.rendering.occupancy import Occupancy
from dreamfields_core.rendering.packing import chunk_size, evaluate_packed
from dreamfields_core.rendering.sampling import Samples, gaussians_at, place_samples
from dreamfields_core.rendering.skipping import choose_samples
from dreamfields_core.types import Array, Params, Rays, Rendering


def render_refined(
    field: Field,
    prepared: Params,
    rays: Rays,
    origin: Array,
    occupancy: Occupancy,
    *,
    samples: int,
    bound: float,
    skip: SkipConfig,
    footprint: float | None = None,
) -> tuple[Rendering, Array]:
    """Rays of shape [R], as `render_rays` renders them without a key, with `skip.refine` fine steps in a coarse one.

    Args:
      samples: fine steps along the cube's diagonal, rounded up to a multiple of `skip.refine`.
      footprint: length of ray that a sample's Gaussian covers, world units; None means a fine step.

    Returns:
      Rendering of shape [R]; [] int32, how many samples the field was asked for in both passes.
    """
    finer = skip.refine if skip.enabled else 1
    fine = place_samples(None, rays, origin, bound=bound, count=-(-samples // finer) * finer)
    fine = fine if footprint is None else with_footprint(fine, jnp.float32(footprint))
    kept, _ = choose_samples(None, fine, origin, occupancy, bound=bound, skip=skip)
    asked = jnp.int32(0)
    rough_density, rough_color = jnp.zeros(kept.shape), jnp.zeros((*kept.shape, 3))
    if finer > 1:
        coarse = middles(fine, finer)
        near, _ = choose_samples(None, coarse, origin, occupancy, bound=bound, skip=skip)
        density, color = _ask(field, prepared, coarse, near, skip=skip)
        worth = repeated(worth_refining(optical_depths(density, coarse.length), threshold=skip.threshold), finer)
        asked, kept = jnp.sum(near, dtype=jnp.int32), kept & worth
        rough_density, rough_color = jnp.where(worth, 0.0, repeated(density, finer)), repeated(color, finer)
    density, color = _ask(field, prepared, fine, kept, skip=skip)
    rendering = composite(
        optical_depths(jnp.where(kept, density, rough_density), fine.length),
        jnp.where(kept[..., None], color, rough_color),
        fine.distances(),
    )
    return rendering, asked + jnp.sum(kept, dtype=jnp.int32)


def with_footprint(samples: Samples, footprint: Array) -> Samples:
    """The same places, each standing for a Gaussian as long as `footprint`.

    A sample's extent is made of its step, so the places are said anew in steps of that length.
    """
    number = jnp.arange(samples.shift.shape[1])[None, :]
    return replace(samples, shift=(number + samples.shift) * (samples.step / footprint) - number, step=footprint)


def middles(fine: Samples, finer: int) -> Samples:
    """One sample [R, S] in the middle of every `finer` of [R, S finer], with the footprint of those.

    Both passes then see one and the same field.
    """
    count = fine.length.shape[0]
    length = jnp.sum(fine.length.reshape(count, -1, finer), axis=-1)
    first = fine.distances().reshape(count, -1, finer)[..., 0] - 0.5 * fine.length.reshape(count, -1, finer)[..., 0]
    number = jnp.arange(length.shape[1])[None, :]
    return replace(fine, shift=(first + 0.5 * length - fine.near[:, None]) / fine.step - number, length=length)


def _ask(field: Field, prepared: Params, samples: Samples, mask: Array, *, skip: SkipConfig) -> tuple[Array, Array]:
    """Density [R, S] and colour [R, S, 3] where the mask [R, S] is True, zeros elsewhere."""
    raw, color = evaluate_packed(field.apply, gaussians_at, chunk_size(skip.chunk), prepared, samples, mask.reshape(-1))
    return jnp.where(mask, field.density(raw).reshape(mask.shape), 0.0), color.reshape(*mask.shape, 3)


def worth_refining(depths: Array, *, threshold: float) -> Array:
    """Steps [R, S] that may colour their pixel by more than `threshold`: w = T (1 - exp(-tau)), paper equation 3.

    A surface may begin within a step whose middle is still empty, so tau is the largest of the step and its two neighbours, and T
    is what reaches the neighbour in front.
    """
    beside = jnp.pad(depths, ((0, 0), (1, 1)))
    largest = jnp.maximum(jnp.maximum(beside[:, :-2], beside[:, 2:]), depths)
    before = transmittance_before(depths)
    reaching = jnp.concatenate([before[:, :1], before[:, :-1]], axis=1)
    return reaching * -jnp.expm1(-largest) > threshold


def repeated(values: Array, times: int) -> Array:
    """[R, S, ...] -> [R, S times, ...], each value `times` times."""
    return jnp.repeat(values, times, axis=1)

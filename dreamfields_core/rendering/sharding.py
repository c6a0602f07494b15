"""The rays of a step on several devices: each places, chooses, packs and composites its own; only pixels and gradients meet."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from dreamfields_core.config import SkipConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.rendering.occupancy import Occupancy
from dreamfields_core.rendering.render import Tally, render_rays
from dreamfields_core.rendering.shares import Share
from dreamfields_core.types import Array, Params, Rays, Rendering

AXIS = "rays"


def device_mesh(wanted: int | None, *, rays: int) -> Mesh | None:
    """The devices that share the rays of a step, None when it is one.

    Args:
      wanted: so many, or None for all of this process if their number divides that of the rays, else one.
      rays: of a step.

    Raises:
      ValueError: more devices are wanted than there are, or the rays cannot be dealt out evenly.
    """
    devices = jax.local_devices()
    if wanted is None:
        wanted = len(devices) if rays % len(devices) == 0 else 1
    if wanted > len(devices):
        raise ValueError(f"expected at most {len(devices)} for render.devices, the number of devices here, got {wanted}")
    if rays % wanted:
        raise ValueError(f"expected render.devices to divide the {rays} rays of a step, got {wanted}: change it, or render.size")
    return Mesh(np.array(devices[:wanted]), (AXIS,)) if wanted > 1 else None


def on_every_device(mesh: Mesh | None, tree: Any) -> Any:
    """Arrays copied to each device of the mesh; left where they are without one, and where they are there already."""
    return tree if mesh is None else jax.device_put(tree, NamedSharding(mesh, PartitionSpec()))


def batch_over(mesh: Mesh | None, batch: Array) -> Array:
    """Tell the compiler to deal the first axis of `batch` out to the devices, where that goes evenly, and only from here on.

    What `batch` is made of is computed on each device whole: left to itself, the compiler would cut up the Fourier transforms
    behind it too, and compiles those for a CPU into what then refuses to run.
    """
    if mesh is None or batch.shape[0] % mesh.size:
        return batch
    whole = jax.lax.with_sharding_constraint(batch, NamedSharding(mesh, PartitionSpec()))
    return jax.lax.with_sharding_constraint(whole, NamedSharding(mesh, PartitionSpec(AXIS)))


def render_rays_over(
    key: Array | None,
    mesh: Mesh | None,
    field: Field,
    prepared: Params,
    rays: Rays,
    origin: Array,
    occupancy: Occupancy,
    *,
    samples: int,
    bound: float,
    skip: SkipConfig,
) -> tuple[Rendering, Tally]:
    """`render_rays` with the rays [R] dealt out to the devices of the mesh, whose number divides R; the same result but for rounding.

    The gradient in `prepared` is the sum of the devices'.
    """
    if mesh is None:
        return render_rays(key, field, prepared, rays, origin, occupancy, samples=samples, bound=bound, skip=skip)

    def one(key: Array | None, prepared: Params, dealt: Rays, origin: Array, occupancy: Occupancy) -> tuple[Rendering, Tally]:
        own = jax.tree.map(lambda leaf: leaf[:, 0], dealt)
        share = Share(first=jax.lax.axis_index(AXIS), of=mesh.size, axis=AXIS)
        rendering, tally = render_rays(key, field, prepared, own, origin, occupancy, samples=samples, bound=bound, skip=skip, share=share)
        return jax.tree.map(lambda leaf: leaf[:, None], rendering), jax.lax.psum(tally, AXIS)

    same, dealt = PartitionSpec(), PartitionSpec(None, AXIS)
    # Each device runs as many chunks as its own rays need: the loops inside differ between devices, which the check of
    # replicated values does not follow.
    everywhere = jax.shard_map(one, mesh=mesh, in_specs=(same, same, dealt, same, same), out_specs=(dealt, same), check_vma=False)
    hands = jax.tree.map(lambda leaf: leaf.reshape(-1, mesh.size, *leaf.shape[1:]), rays)
    rendering, tally = everywhere(key, prepared, hands, origin, occupancy)
    # Pixels are few: every device has all of them from here on, so that the compiler invents no way of its own to cut them up.
    pixels = jax.lax.with_sharding_constraint(rendering, NamedSharding(mesh, same))
    return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:]), pixels), tally

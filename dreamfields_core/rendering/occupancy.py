"""A coarse grid that remembers where the scene is, so that the renderer can leave out where it is not.

The grid moves with the scene's origin. A cell holds a running maximum of the density found at random points inside it; it
counts as empty when a step through it would be almost transparent, and so do all its neighbours.
"""

from __future__ import annotations

import flax.struct
import jax
import jax.numpy as jnp

from dreamfields_core.fields.contract import Field, points_as_gaussians
from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Params

DENSEST = 1e6
"""What is denser is remembered as this: opaque at any step, and forgotten in as many refreshes as it takes to fade by this much."""


@flax.struct.dataclass
class Occupancy:
    """density: [G, G, G] remembered density of each cell. known: [] bool, False until the first refresh."""

    density: Array
    known: Array

    @property
    def resolution(self) -> int:
        return self.density.shape[0]


def unknown_occupancy(resolution: int) -> Occupancy:
    """Before anything is known: everything counts as occupied."""
    return Occupancy(density=jnp.zeros((resolution,) * 3), known=jnp.zeros((), bool))


def refresh(key: Array, occupancy: Occupancy, field: Field, prepared: Params, origin: Array, *, bound: float, decay: float) -> Occupancy:
    """Ask the field at one random point in every cell: density <- max(decay x density, what was found there)."""
    side = occupancy.resolution
    corners = jnp.stack(jnp.meshgrid(*(jnp.arange(side),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    place = (corners + jax.random.uniform(key, corners.shape)) * (2.0 * bound / side) - bound
    raw, _ = field.apply(prepared, points_as_gaussians(origin[None, :] + place))
    found = field.density(in_float32(raw)).reshape((side,) * 3)
    # Not a number, once remembered, would stay: the larger of it and anything is itself, and no comparison calls it occupied.
    # A field in that state is kept in sight, so that the step that mends it or gives it up sees it.
    found = jnp.where(found < DENSEST, found, DENSEST)
    return Occupancy(density=jnp.maximum(decay * occupancy.density, found), known=jnp.ones((), bool))


def cell_index(points: Array, origin: Array, *, bound: float, resolution: int) -> Array:
    """Flat index [...] of the cell that each point [..., 3] lies in; points outside take the nearest cell."""
    cell = jnp.floor((points - jnp.broadcast_to(origin, points.shape) + bound) * (resolution / (2.0 * bound)))
    # Clipped before the conversion: what a float beyond the integers becomes is not defined.
    cell = jnp.clip(cell, 0, resolution - 1).astype(jnp.int32)
    return (cell[..., 0] * resolution + cell[..., 1]) * resolution + cell[..., 2]


def occupied_cells(occupancy: Occupancy, *, step: Array | float, threshold: float) -> Array:
    """Cells whose optical depth a step, or a neighbour's, reaches the threshold; [G, G, G] bool."""
    filled = occupancy.density * step >= threshold
    for axis in range(3):
        filled = filled | _shifted(filled, 1, axis) | _shifted(filled, -1, axis)
    return filled | ~occupancy.known


def inner_density(occupancy: Occupancy) -> Array:
    """The least density remembered of a cell and its 26 neighbours, nothing beyond the border; [G, G, G].

    Positive only deep inside: a cell that a flat surface cuts has a neighbour wholly outside, whichever way the surface leans,
    so a ray that grazes an object passes through no cell that counts here.
    """
    least = occupancy.density
    for axis in range(3):
        least = jnp.minimum(least, jnp.minimum(_shifted(least, 1, axis), _shifted(least, -1, axis)))
    return least


def _shifted(filled: Array, by: int, axis: int) -> Array:
    """Roll without wrapping: what comes in at the border is empty."""
    rolled = jnp.roll(filled, by, axis=axis)
    border = [slice(None)] * 3
    border[axis] = slice(0, 1) if by > 0 else slice(-1, None)
    return rolled.at[tuple(border)].set(jnp.zeros((), filled.dtype))

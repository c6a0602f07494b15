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
    found = _ask(key, corners, field, prepared, origin, bound=bound, side=side).reshape((side,) * 3)
    return Occupancy(density=jnp.maximum(decay * occupancy.density, found), known=jnp.ones((), bool))


def refresh_some(
    key: Array,
    occupancy: Occupancy,
    field: Field,
    prepared: Params,
    origin: Array,
    *,
    turn: Array,
    turns: int,
    bound: float,
    decay: float,
) -> Occupancy:
    """The same of one cell in `turns`, others each time: in as many turns in a row, every cell is asked once.

    A cell that is not asked keeps what it remembers, and forgets all the more once it is: by decay ^ turns, as if it had been asked each
    time. Most of the cells around it are asked at other turns: as a cell counts as occupied where any of the 27 is, little is missed of
    what moves less than a cell in that time.

    Args:
      turn: [] int32, the refresh's number. turns: divides the resolution.

    Raises:
      ValueError: turns that do not divide the resolution.
    """
    side = occupancy.resolution
    if side % turns:
        raise ValueError(f"expected turns that divide the {side} cells a side, got {turns}: change skip.refresh_turns, or skip.resolution")
    x, y, z = jnp.meshgrid(jnp.arange(side), jnp.arange(side), jnp.arange(0, side, turns), indexing="ij")
    corners = jnp.stack([x, y, z + (turn + 3 * x + 5 * y) % turns], axis=-1).reshape(-1, 3)
    found = _ask(key, corners, field, prepared, origin, bound=bound, side=side)
    cells = tuple(corners.T)
    density = occupancy.density.at[cells].set(jnp.maximum(decay**turns * occupancy.density[cells], found))
    return Occupancy(density=density, known=occupancy.known)


def _ask(key: Array, corners: Array, field: Field, prepared: Params, origin: Array, *, bound: float, side: int) -> Array:
    """Density [N] at a random point in each of the cells whose numbers [N, 3] these are."""
    place = (corners + jax.random.uniform(key, corners.shape)) * (2.0 * bound / side) - bound
    raw, _ = field.apply(prepared, points_as_gaussians(origin[None, :] + place))
    found = field.density(in_float32(raw))
    # Not a number, once remembered, would stay: the larger of it and anything is itself, and no comparison calls it occupied.
    # A field in that state is kept in sight, so that the step that mends it or gives it up sees it.
    return jnp.where(found < DENSEST, found, DENSEST)


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

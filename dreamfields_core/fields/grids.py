"""Feature grids: resampling one to another resolution, reading between its vertices, and how rough it is.

Symbols: a grid of resolution G has (G + 1)^D vertices, the outer ones on the faces of the cube of half-side `bound`; D is 3, or 2 for
a picture.
"""

from __future__ import annotations

import itertools
import operator
from functools import reduce

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.types import Array

HIGHEST = jax.lax.Precision.HIGHEST
"""Float32 throughout: some accelerators would otherwise round what goes into a matrix product."""


def resampling_matrix(coarse: int, fine: int) -> np.ndarray:
    """[fine + 1, coarse + 1] weights of linear interpolation along one axis."""
    place = np.arange(fine + 1) * (coarse / fine)
    distance = np.abs(place[:, None] - np.arange(coarse + 1)[None, :])
    return np.maximum(0.0, 1.0 - distance).astype(np.float32)


def resample(grid: Array, *, resolution: int) -> Array:
    """Trilinear resampling of [g+1, g+1, g+1, C] to [G+1, G+1, G+1, C], one axis after another."""
    if grid.shape[0] == resolution + 1:  # three products with the identity cost as much as any others
        return grid
    matrix = jnp.asarray(resampling_matrix(grid.shape[0] - 1, resolution))
    grid = jnp.einsum("xi,ijkc->xjkc", matrix, grid, precision=HIGHEST)
    grid = jnp.einsum("yj,xjkc->xykc", matrix, grid, precision=HIGHEST)
    return jnp.einsum("zk,xykc->xyzc", matrix, grid, precision=HIGHEST)


def read_grid(grid: Array, points: Array, *, bound: float) -> Array:
    """Linear interpolation along every axis of grid [G+1, ..., G+1, C] at points [N, D]; outside the cube, the nearest face's value.

    Returns [N, C].
    """
    axes = range(grid.ndim - 1)
    resolution = grid.shape[0] - 1
    place = jnp.clip((points / bound + 1.0) * (0.5 * resolution), 0.0, resolution)
    corner = jnp.minimum(place.astype(jnp.int32), resolution - 1)
    fraction = place - corner
    rows = grid.reshape(-1, grid.shape[-1])
    side = resolution + 1
    first = reduce(lambda row, axis: row * side + corner[:, axis], axes, jnp.zeros_like(corner[:, 0]))
    total = jnp.zeros((points.shape[0], grid.shape[-1]), grid.dtype)
    for ends in itertools.product((0, 1), repeat=len(axes)):
        weight = reduce(operator.mul, [_share(fraction[:, axis], end) for axis, end in zip(axes, ends)])
        total = total + weight[:, None] * rows[first + reduce(lambda row, end: row * side + end, ends)]
    return total


def total_variation(grid: Array) -> Array:
    """Mean squared difference between neighbouring vertices, summed over the axes; []."""
    return sum(
        (jnp.mean((_neighbours(grid, 1, axis) - _neighbours(grid, 0, axis)) ** 2) for axis in range(grid.ndim - 1)), start=jnp.zeros(())
    )


def _neighbours(grid: Array, begin: int, axis: int) -> Array:
    """All vertices along an axis but the last (begin 0) or the first (1). Slices: the gradient of jnp.diff takes four times as long."""
    return jax.lax.slice_in_dim(grid, begin, begin + grid.shape[axis] - 1, axis=axis)


def _share(fraction: Array, side: int) -> Array:
    return fraction if side else 1.0 - fraction

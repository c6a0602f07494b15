"""A field's level set as triangles, asked only where the surface can be.

Coarse to fine: a lattice of about 64 cells a side is asked whole; a cell where the field changes sign is cut in eight, and of the
others those octants are looked into that may hold a zero: every corner c has |g(c)| <= L d, g the field minus the level, L its steepest
slope, d from c to the farthest point of the octant. What that misses (a thin wire) is found by following the surface from cell to cell.

The field is taken before its activation: a log-density is nearly straight across a cell, where the density itself bends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dreamfields_core.meshing.bends import cut_bends
from dreamfields_core.meshing.cases import CORNERS
from dreamfields_core.meshing.errors import FieldEmpty, FieldFull
from dreamfields_core.meshing.lattice import Field, Lattice, Packed, Progress, Samples, distinct
from dreamfields_core.meshing.marching import march
from dreamfields_core.types import Mesh

STEEPEST = 1.25
"""Times the 99.9th percentile of the coarse slopes: at 1.05 every detached speck of a fifth of a coarse cell was found."""

FARTHEST = np.sqrt(np.where(CORNERS[:, None] == CORNERS[None], 0.25, 1.0).sum(axis=-1))
"""[8, 8] from octant o of a unit cell to its corner c: the distance of the octant's farthest point."""

_SIDES = np.concatenate([np.eye(3, dtype=np.int64), -np.eye(3, dtype=np.int64)])
_SIDE_CORNERS = np.array([[c for c in range(8) if CORNERS[c][i % 3] == (i < 3)] for i in range(6)])


def isosurface(
    field: Field,
    level: float,
    *,
    origin: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    bound: float = 1.0,
    resolution: int = 128,
    steps: int = 2,
    batch: int = 32768,
    progress: Progress | None = None,
) -> Mesh:
    """The surface field = level in the cube of half-side `bound` about `origin` [3], closed where it meets the bounds.

    field: see `lattice.Field`; inside is field > level. resolution: 2..128 or a multiple of 64. steps: of false position.
    Returns a closed manifold, outward winding, without colours; where the bounds cut it, it ends 0.001 cells beyond them.

    Raises:
      FieldNotFinite, FieldEmpty, FieldFull, BadResolution: see `errors`.
    """
    x, y, z = (float(value) for value in origin)
    samples = Samples(Lattice((x, y, z), bound, resolution), Packed(field, batch=batch, progress=progress))
    return extract(samples, coarse_values(samples), level, steps=steps)


def coarse_values(samples: Samples) -> np.ndarray:
    """[n+1, n+1, n+1] values at all corners of the coarse lattice."""
    lattice = samples.lattice
    axis = np.arange(lattice.coarse + 1) * lattice.stride
    return samples.at(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1))


def extract(samples: Samples, coarse: np.ndarray, level: float, *, steps: int = 2) -> Mesh:
    """As `isosurface`, from samples whose coarse values [n+1, n+1, n+1] are known."""
    cells = surface_cells(samples, coarse, level)
    if not len(cells):
        if (coarse > level).all():
            raise FieldFull(
                f"expected values below the surface's level somewhere in the cube, got {coarse.min() - level:.4g} above it at the least: "
                "raise the level, or dream with a stronger transmittance loss"
            )
        raise FieldEmpty(
            f"expected values above the surface's level somewhere in the cube, got {level - coarse.max():.4g} below it at the least: "
            "lower the level, or dream with a weaker transmittance loss"
        )
    return cut_bends(march(samples, cells, level, steps=steps), samples, level)


def slope(coarse: np.ndarray, width: float) -> float:
    """L: STEEPEST times the 99.9th percentile of the gradient's length on a lattice [n+1, n+1, n+1] of cells that wide."""
    n = coarse.shape[0] - 1
    squares = sum(np.square(np.diff(coarse, axis=axis)[:n, :n, :n].astype(np.float64)) for axis in range(3))
    return STEEPEST * float(np.quantile(np.sqrt(squares), 0.999)) / width


def surface_cells(samples: Samples, coarse: np.ndarray, level: float) -> np.ndarray:
    """Lowest corners [K, 3] of all the finest cells, those of the layer outside included, that the surface passes through.

    A field that is inside at every coarse corner has none: it is full.
    """
    lattice = samples.lattice
    if (coarse > level).all():
        return np.empty((0, 3), np.int64)
    n, stride = lattice.coarse, lattice.stride
    steepest = slope(coarse, lattice.cell * stride)
    cells = np.indices((n, n, n)).reshape(3, -1).T * stride
    g = np.stack([coarse[x : n + x, y : n + y, z : n + z].ravel() for x, y, z in CORNERS], axis=-1) - level
    while stride > 1:
        surely = _crossed(g) | _meets_bounds(cells, stride, g, lattice.resolution)
        cell, octant = np.nonzero(surely[:, None] | _may_cross(g, steepest * lattice.cell * stride))
        stride //= 2
        cells = cells[cell] + CORNERS[octant] * stride
        g = _corner_values(samples, cells, stride) - level
    return _follow(samples, cells[_crossed(g) | _meets_bounds(cells, stride, g, lattice.resolution)], level)


def _corner_values(samples: Samples, cells: np.ndarray, stride: int) -> np.ndarray:
    return samples.at(cells[:, None] + CORNERS * stride)


def _crossed(g: np.ndarray) -> np.ndarray:
    inside = g > 0
    return np.not_equal(inside.any(axis=1), inside.all(axis=1))


def _may_cross(g: np.ndarray, steepest: float) -> np.ndarray:
    """[K, 8] which octants of cells with corner values g [K, 8] may hold a zero,
    the field changing by at most `steepest` over the width of a cell.

    A corner vouches for all that lies within |g| / steepest of it; an octant that lies within one corner's word holds no zero.
    """
    return np.stack([(np.abs(g) <= steepest * FARTHEST[octant]).all(axis=1) for octant in range(8)], axis=-1)


def _meets_bounds(cells: np.ndarray, stride: int, g: np.ndarray, resolution: int) -> np.ndarray:
    """Cells at the cube's boundary with a corner inside: the surface that closes the object lies just outside them."""
    return np.logical_and(((cells == 0) | (cells + stride == resolution)).any(axis=1), (g > 0).any(axis=1))


def _follow(samples: Samples, cells: np.ndarray, level: float) -> np.ndarray:
    """All cells that the surface reaches from these through shared faces on which the sign changes."""
    lattice = samples.lattice
    edge = ((cells == 0) | (cells == lattice.resolution - 1)).any(axis=1)
    around = (cells[edge][:, None] + _SIDES).reshape(-1, 3)
    beyond = around[((around < 0) | (around >= lattice.resolution)).any(axis=1)]
    known = np.empty(0, np.int64)
    frontier = distinct(lattice.key(np.concatenate([cells, beyond])))
    while len(frontier):
        cells = lattice.corners(frontier)
        g = _corner_values(samples, cells, 1) - level
        cells, g = cells[_crossed(g)], g[_crossed(g)]
        known = np.union1d(known, lattice.key(cells))
        reached = [lattice.key((cells + _SIDES[i])[_crossed(g[:, _SIDE_CORNERS[i]])]) for i in range(6)]
        frontier = np.setdiff1d(distinct(np.concatenate(reached)), known, assume_unique=True)
    return lattice.corners(known)

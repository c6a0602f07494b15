"""The regular lattice that a field is asked on, and the memory of what it answered.

Symbols: R cells a side, corners numbered 0..R along each axis, h the width of a cell, b the half-side of the cube. One more
layer of corners, -1 and R + 1, stands outside the cube and counts as empty, so that a surface touching the bounds closes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dreamfields_core.config.results import coarse_cells
from dreamfields_core.meshing.errors import BadResolution, FieldNotFinite

Field = Callable[[np.ndarray], np.ndarray]
"""points [N, 3] float32, world space -> [N] values before activation (log-density-like), larger inside."""

Progress = Callable[[int], None]
"""Told the number of points asked so far."""

OUTSIDE = -np.inf
"""Value of every corner outside the cube."""


@dataclass(frozen=True)
class Lattice:
    """A cube of half-side `bound` about `origin` [3], cut into `resolution` cells a side.

    Raises:
      BadResolution: the resolution cannot be halved down to a coarse lattice of at most 128, or the cube is no cube.
    """

    origin: tuple[float, float, float]
    bound: float
    resolution: int

    def __post_init__(self) -> None:
        if not (np.isfinite(self.bound) and self.bound > 0 and np.shape(self.origin) == (3,) and np.isfinite(self.origin).all()):
            raise BadResolution(f"expected a positive half-side about a finite origin [3], got {self.bound} about {self.origin}")
        if self.resolution < 2 or self.coarse > 128:
            raise BadResolution(
                f"expected a resolution of 2 to 128 or a multiple of 64, got {self.resolution}: take {max(1, self.resolution // 64) * 64}"
            )

    @property
    def coarse(self) -> int:
        """Cells a side of the lattice that is asked whole."""
        return coarse_cells(self.resolution)

    @property
    def stride(self) -> int:
        """Fine cells in a coarse one, along an axis."""
        return self.resolution // self.coarse

    @property
    def cell(self) -> float:
        """h, world units."""
        return 2 * self.bound / self.resolution

    def place(self, corners: np.ndarray) -> np.ndarray:
        """World positions [..., 3] float64 of corners [..., 3], which may be fractional."""
        return np.asarray(self.origin) + self.bound * (2 * np.asarray(corners, np.float64) / self.resolution - 1)

    def key(self, corners: np.ndarray) -> np.ndarray:
        """One int64 for each corner [..., 3] of -1..R+1; also for a cell, by its lowest corner."""
        side = self.resolution + 3
        shifted = np.asarray(corners, np.int64) + 1
        return (shifted[..., 0] * side + shifted[..., 1]) * side + shifted[..., 2]

    def corners(self, keys: np.ndarray) -> np.ndarray:
        """The inverse of `key`: [...] -> [..., 3]."""
        side = self.resolution + 3
        return np.stack([keys // (side * side), keys // side % side, keys % side], axis=-1) - 1


def distinct(keys: np.ndarray) -> np.ndarray:
    """As np.unique, whose hash table is several times slower than sorting for the millions of keys here."""
    ordered = np.sort(keys, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


class Count:
    """The points that a field was asked for, padding left out; `progress` is told after every batch."""

    def __init__(self, progress: Progress | None) -> None:
        self.points, self._progress = 0, progress

    def add(self, points: int) -> None:
        self.points += points
        if self._progress is not None:
            self._progress(self.points)


class Packed:
    """A field asked in batches of one size, the last one padded, so that a jitted field compiles once."""

    def __init__(self, field: Field, *, batch: int = 32768, progress: Progress | None = None) -> None:
        self.field, self.batch, self._count = field, batch, Count(progress)

    @property
    def asked(self) -> int:
        """Points so far, those included that were asked by way of `above`."""
        return self._count.points

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """points [N, 3] -> values [N] float32.

        Raises:
          FieldNotFinite: NaN, infinity, or a wrong shape.
        """
        answers = [self._one(points[start : start + self.batch]) for start in range(0, len(points), self.batch)]
        return np.concatenate(answers) if answers else np.empty(0, np.float32)

    def above(self, levels: Field) -> Packed:
        """The field minus a level for every place, points [N, 3] -> [N]; both count together."""
        lowered = Packed(lambda points: np.asarray(self.field(points), np.float32) - levels(points), batch=self.batch)
        lowered._count = self._count
        return lowered

    def _one(self, points: np.ndarray) -> np.ndarray:
        points = np.ascontiguousarray(points, np.float32)
        padded = np.concatenate([points, np.broadcast_to(points[-1], (self.batch - len(points), 3))])
        values = np.asarray(self.field(padded), np.float32)
        if values.shape != (self.batch,):
            raise FieldNotFinite(f"expected one value a point, [{self.batch}], got {list(values.shape)}: drop or squeeze the last axis")
        values = values[: len(points)]
        bad = ~np.isfinite(values)
        if bad.any():
            where = ", ".join(f"{x:.3g}" for x in points[np.argmax(bad)])
            raise FieldNotFinite(
                f"expected finite values of the field, got {bad.sum()} that are not among {len(points)}, the first at ({where}): "
                "mesh an earlier checkpoint"
            )
        self._count.add(len(points))
        return values


class Samples:
    """What the field answered at lattice corners: no corner is asked twice."""

    def __init__(self, lattice: Lattice, ask: Packed) -> None:
        self.lattice, self.ask = lattice, ask
        self._keys, self._values = np.empty(0, np.int64), np.empty(0, np.float32)

    def at(self, corners: np.ndarray) -> np.ndarray:
        """Values [...] float32 at corners [..., 3]; OUTSIDE beyond the cube; what is not known yet is asked."""
        keys = self.lattice.key(corners)
        beyond = ((corners < 0) | (corners > self.lattice.resolution)).any(axis=-1)
        self._learn(np.setdiff1d(distinct(keys[~beyond]), self._keys, assume_unique=True))
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(beyond, np.float32(OUTSIDE), self._values[place])

    def above(self, levels: Field) -> Samples:
        """The same of the field minus a level for every place, points [N, 3] -> [N]; what is known is not asked again."""
        lowered = Samples(self.lattice, self.ask.above(levels))
        lowered._keys = self._keys
        lowered._values = self._values - levels(self.lattice.place(self.lattice.corners(self._keys)))
        return lowered

    def _learn(self, keys: np.ndarray) -> None:
        if len(keys):
            values = self.ask(self.lattice.place(self.lattice.corners(keys)))
            merged = np.concatenate([self._keys, keys])
            order = np.argsort(merged, kind="stable")
            self._keys, self._values = merged[order], np.concatenate([self._values, values])[order]

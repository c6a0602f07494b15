"""A level for every place: one for the whole field is a compromise between what is thin but opaque and haze in front of nothing.

Symbols: a ray's peak is the field's largest value along it, its place where that is; a level tells a ray right if "the peak is above
it" and "the renderer saw the ray as opaque" are both true or both false.

Where haze hangs, all rays are clear and their peaks low: there the level rises above them and the haze is gone. Where the object is
thin and translucent the level sinks. At a sharp edge it lies between the last opaque and the first clear ray. Which level tells
most rays right is counted at every corner of a small lattice, rays weighed by their distance, and the answers are smoothed, so that the
surface is still, nearly, one level set of the field wherever one looks closely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, zoom

from dreamfields_core.meshing.lattice import Lattice
from dreamfields_core.meshing.level import Level, Views, agreement, choose_level, highest

NODES = 24
"""Cells a side of the lattice that levels are counted on."""
SPREAD = 1.0
"""Cells of that lattice: standard deviation of the weight of a ray, and of the smoothing."""
CHOICES = 96
"""Levels tried, evenly spaced over those that are in question at all."""
DOUBT = 0.5
"""Rays, right at the corner, that outweigh going from the level before to the farthest choice; less by the square of the way."""
ROUNDS = 2
"""Of counting: smoothing takes the tops off the levels that were counted, and under other levels other places of a ray decide."""
FINER = 4
"""Cells that a counted one is cut into, by cubic splines: between them levels are straight, and a coarse kink would show as a crease."""


@dataclass(frozen=True)
class Levels:
    """values: [m, m, m] raw, as the field gives it, at the corners of a lattice over the cube of half-side `bound` about `origin` [3]."""

    values: np.ndarray
    origin: tuple[float, float, float]
    bound: float

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """[N] float32 at points [N, 3] in world space."""
        index = ((np.asarray(points, np.float32) - np.asarray(self.origin, np.float32)) / self.bound + 1) * ((len(self.values) - 1) / 2)
        return np.asarray(map_coordinates(self.values, index.T, order=1, mode="nearest", output=np.float32))


def levels_of(views: Views, coarse: np.ndarray, lattice: Lattice) -> tuple[Level, Levels]:
    """The best single level for a field whose values [n+1, n+1, n+1] on the coarse lattice are known, and the best at every place.

    The agreement is that of the levels by place.

    Raises:
      SilhouetteEmpty: no view is opaque anywhere.
    """
    opaque = np.asarray(views.opacity).reshape(len(views.opacity), -1) > 0.5
    peaks, places = _peaks(views, coarse, lattice)
    level = choose_level(peaks, opaque)
    levels = Levels(np.full((FINER * NODES + 1,) * 3, level.value, np.float32), lattice.origin, lattice.bound)
    peaks = peaks - level.value
    for _ in range(ROUNDS):
        met = np.isfinite(peaks)
        nodes = np.rint(((places[met] - np.asarray(lattice.origin)) / lattice.bound + 1) * NODES / 2)
        counted = count_levels(peaks[met], np.clip(nodes, 0, NODES).astype(np.int64), opaque[met])
        smooth = gaussian_filter(counted, SPREAD, mode="nearest")
        levels = replace(levels, values=levels.values + zoom(smooth, len(levels.values) / len(smooth), order=3, mode="nearest"))
        peaks, places = _peaks(views, coarse - _at_corners(levels, lattice), lattice)
    seen = opaque.any(axis=1)
    told = [agreement(view, mask, np.zeros(1))[0] for view, mask in zip(peaks[seen], opaque[seen], strict=True)]
    return Level(level.value, float(np.mean(told))), levels


def count_levels(peaks: np.ndarray, nodes: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """[NODES + 1] ** 3 float32, the level at each corner that tells most rays right; of several the nearest to 0.

    peaks: [N]. nodes: [N, 3] integers, the corner nearest to each ray's place. opaque: [N] bool.
    """
    side = NODES + 1
    low, high = np.quantile(peaks[opaque], 0.001), np.quantile(peaks[~opaque], 0.999) if not opaque.all() else -np.inf
    if low >= high:  # one level tells all rays right
        return np.zeros((side, side, side), np.float32)
    low, high = min(low, 0.0), max(high, 0.0)
    choices = np.linspace(low, high, CHOICES)
    above = np.searchsorted(choices, peaks)  # how many of the choices lie below the peak
    counts = np.zeros((2, side, side, side, CHOICES + 1), np.float32)
    np.add.at(counts, (opaque.astype(int), *nodes.T, above), 1)
    clear, solid = gaussian_filter(counts, (0, SPREAD, SPREAD, SPREAD, 0), mode="constant")
    # Choice k is wrong about solid rays with at most k choices below them, and about clear rays with more.
    wrong = np.cumsum(solid, axis=-1)[..., :-1] + np.cumsum(clear[..., ::-1], axis=-1)[..., -2::-1]
    # One ray weighs most right at its own corner.
    one = (2 * np.pi * SPREAD**2) ** -1.5
    return choices[np.argmin(wrong + DOUBT * one * (choices / (high - low)) ** 2, axis=-1)].astype(np.float32)


def _peaks(views: Views, values: np.ndarray, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """[V, N] peaks and [V, N, 3] their places."""
    both = [highest(values, lattice, views.origins[v], views.directions[v]) for v in range(len(views.opacity))]
    return np.stack([peak for peak, _ in both]), np.stack([place for _, place in both])


def _at_corners(levels: Levels, lattice: Lattice) -> np.ndarray:
    """[n+1, n+1, n+1] at the coarse lattice's corners."""
    axis = np.arange(lattice.coarse + 1) * lattice.stride
    corners = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    return levels(lattice.place(corners).reshape(-1, 3)).reshape(corners.shape[:3])

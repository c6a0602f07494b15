"""The iso-level whose silhouettes agree best with what the renderer saw as opaque.

No fixed density does: 25 to 30 gave an intersection over union of 0.71 to 0.98 on measured dreams, the best level 0.96 to 0.99.
A ray meets the surface field = level exactly if the largest value along it exceeds the level. So one number a
ray, its peak, holds the silhouettes at all levels, and the best one is found by counting instead of searching.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from dreamfields_core.meshing.errors import SilhouetteEmpty
from dreamfields_core.meshing.lattice import Lattice

PLATEAU = 1e-3
"""Levels whose agreement is this near the best count as equally good: the middle one is the least chancy."""


@dataclass(frozen=True)
class Views:
    """What some cameras saw. Silhouettes are compared view by view.

    origins, directions: [V, ..., 3] rays, world space, unit directions.
    opacity: [V, ...] in [0, 1], 1 minus transmittance.
    """

    origins: np.ndarray
    directions: np.ndarray
    opacity: np.ndarray


@dataclass(frozen=True)
class Level:
    """value: raw, as the field gives it. agreement: mean intersection over union of the silhouettes, in [0, 1]."""

    value: float
    agreement: float


def choose_level(peaks: np.ndarray, opaque: np.ndarray) -> Level:
    """The level that maximises the mean over views of |peak > level AND opaque| / |peak > level OR opaque|.

    peaks: [V, N], -inf for rays that miss the cube. opaque: [V, N] bool. Views that see nothing opaque are left out.

    Raises:
      SilhouetteEmpty: no view is opaque anywhere that a ray meets the cube.
    """
    peaks, opaque = (array[opaque.any(axis=1)] for array in (peaks, opaque))
    values = np.unique(peaks[np.isfinite(peaks)])
    if not opaque.any() or len(values) < 2:
        raise SilhouetteEmpty(
            "expected an object that covers more than half of some pixel, got views that are empty: "
            "dream longer or with a weaker transmittance loss, or set mesh.level"
        )
    levels = (values[1:] + values[:-1]) / 2
    scores = np.mean([agreement(view, mask, levels) for view, mask in zip(peaks, opaque, strict=True)], axis=0)
    best = int(np.argmax(scores))
    good = scores >= scores[best] - PLATEAU
    low = best - int(np.argmin(np.append(good[best::-1], False))) + 1
    high = best + int(np.argmin(np.append(good[best:], False))) - 1
    middle = float(levels[low] + levels[high]) / 2
    return Level(middle, float(scores[np.argmin(np.abs(levels - middle))]))


def agreement(peaks: np.ndarray, opaque: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Intersection over union of (peaks [N] > level) and opaque [N], for each of the levels [L]."""
    above = len(peaks) - np.searchsorted(np.sort(peaks), levels, side="right")
    hits = np.sort(peaks[opaque])
    both = len(hits) - np.searchsorted(hits, levels, side="right")
    return np.asarray(both / (len(hits) + above - both))


def highest(coarse: np.ndarray, lattice: Lattice, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest value [N] along each ray [..., 3] in the cube, trilinear between coarse corners, and where it is [N, 3];
    -inf where the cube is missed.
    """
    origins, directions = (np.asarray(rays, np.float64).reshape(-1, 3) for rays in np.broadcast_arrays(origins, directions))
    near, far = chord(origins - np.asarray(lattice.origin), directions, lattice.bound)
    n, hit = lattice.coarse, far > near
    starts, steps = (origins + near[:, None] * directions)[hit], ((far - near)[:, None] * directions)[hit]
    best, share = np.full(len(starts), -np.inf), np.zeros(len(starts))
    for k in np.linspace(0, 1, 2 * n + 1):  # at most 0.87 of a coarse cell apart
        index = ((starts + k * steps - np.asarray(lattice.origin)) / lattice.bound + 1) * (n / 2)
        values = map_coordinates(coarse, index.T, order=1, mode="nearest")
        share = np.where(values > best, k, share)
        best = np.maximum(best, values)
    peaks, places = np.full(len(origins), -np.inf), origins.copy()
    peaks[hit], places[hit] = best, starts + share[:, None] * steps
    return peaks, places


def chord(origins: np.ndarray, directions: np.ndarray, bound: float) -> tuple[np.ndarray, np.ndarray]:
    """Where rays [N, 3] enter and leave the cube of half-side `bound` about 0: near [N], far [N]; far <= near means a miss.

    A component of 0 is nudged rather than divided by: inf x 0 would be NaN for a ray that runs in a side of the cube.
    """
    safe = np.where(np.abs(directions) < 1e-12, 1e-12, directions)
    first, second = (-bound - origins) / safe, (bound - origins) / safe
    near = np.minimum(first, second).max(axis=1)
    return np.maximum(near, 0.0), np.maximum(first, second).min(axis=1)

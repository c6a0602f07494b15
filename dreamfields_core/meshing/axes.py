"""Z up, as the project has it, and Y up, as most files for engines do. One scene unit is one metre in files that have units."""

from __future__ import annotations

import numpy as np


def to_y_up(points: np.ndarray) -> np.ndarray:
    """[..., 3] Z up -> Y up, a rotation."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def to_z_up(points: np.ndarray) -> np.ndarray:
    """The inverse of `to_y_up`."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)

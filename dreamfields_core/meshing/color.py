"""Colours of vertices, asked of the field where its light comes from: a little below the surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dreamfields_core.meshing.errors import FieldNotFinite
from dreamfields_core.types import Mesh

FieldColors = Callable[[np.ndarray], np.ndarray]
"""points [N, 3] float32, world space -> colours [N, 3] in [0, 1], not premultiplied."""


def vertex_normals(mesh: Mesh) -> np.ndarray:
    """[V, 3] float64 unit normals, each face weighed by its area; 0 for a vertex whose faces cancel."""
    vertices = np.asarray(mesh.vertices, np.float64)
    a, b, c = np.moveaxis(vertices[mesh.faces], 1, 0)
    weighted = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    corner = np.asarray(mesh.faces).ravel()
    total = np.stack([np.bincount(corner, weights=weighted[:, i], minlength=len(vertices)) for i in range(3)], axis=-1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(length > 0, length, 1))


def colors_from(field_colors: FieldColors, vertices: np.ndarray, *, batch: int = 32768) -> np.ndarray:
    """[V, 3] float32 in [0, 1] at points [V, 3], asked in batches of one size so that a jitted field compiles once.

    Raises:
      FieldNotFinite: a colour is NaN or infinite, or not [N, 3].
    """
    answers = []
    for start in range(0, len(vertices), batch):
        points = np.asarray(vertices[start : start + batch], np.float32)
        padded = np.concatenate([points, np.broadcast_to(points[-1], (batch - len(points), 3))])
        colors = np.asarray(field_colors(padded), np.float32)
        if colors.shape != (batch, 3):
            raise FieldNotFinite(f"expected a colour a point, [{batch}, 3], got {list(colors.shape)}: give red, green and blue alone")
        bad = np.count_nonzero(~np.isfinite(colors[: len(points)]).all(axis=1))
        if bad:
            raise FieldNotFinite(
                f"expected finite colours of the field, got {bad} that are not of {len(points)}: mesh an earlier checkpoint"
            )
        answers.append(colors[: len(points)])
    return np.clip(np.concatenate(answers), 0, 1) if answers else np.empty((0, 3), np.float32)


def srgb_to_linear(colors: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, elementwise on [0, 1]."""
    return np.where(colors <= 0.04045, colors / 12.92, ((np.maximum(colors, 0.04045) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(colors: np.ndarray) -> np.ndarray:
    """The inverse of `srgb_to_linear`."""
    return np.where(colors <= 0.0031308, colors * 12.92, 1.055 * np.maximum(colors, 0.0031308) ** (1 / 2.4) - 0.055)

"""The field seen from the surface of a mesh: where exactly its level lies, which way it falls, what colour shines out.

Symbols: g the field minus the level, positive inside; n the unit normal, outward.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dreamfields_core.meshing.color import FieldColors, colors_from, vertex_normals
from dreamfields_core.meshing.lattice import Packed
from dreamfields_core.types import Mesh

SurfaceColors = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(points [N, 3] on the surface, outward unit normals [N, 3]) -> display colours [N, 3] in [0, 1]."""

Density = Callable[[np.ndarray], np.ndarray]
"""Raw values [N] of the field -> density [N] >= 0, in 1 / world unit."""

GRAZING = 0.2
"""Cosine to the mesh's own normal below which the field's is not believed: a ridge of noise, or the other side of a thin wall."""


@dataclass(frozen=True)
class Surface:
    """What the bake asks of a field.

    ask: points [N, 3] -> raw values [N]. level: raw. cell: width of a cell of the extraction, world units. colors: see SurfaceColors.
    """

    ask: Packed
    level: float
    cell: float
    colors: SurfaceColors


def just_below(field_colors: FieldColors, *, inset: float, batch: int = 32768) -> SurfaceColors:
    """The field's colour `inset` world units under the surface, where its light comes from."""
    return lambda points, normals: colors_from(field_colors, points - inset * normals, batch=batch)


def through(
    ask: Packed, field_colors: FieldColors, density: Density, *, above: float, below: float, samples: int, batch: int = 32768
) -> SurfaceColors:
    """What a ray sees that comes straight down onto the surface: colours weighed by how much of the light each depth stops.

    above, below: world units over and under the surface; samples: at the middles of as many equal steps (Max 1995, equation 17).
    """
    step = (above + below) / samples
    depths = (np.arange(samples) + 0.5) * step - above

    def colors(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        transmittance, seen = np.ones(len(points)), np.zeros((len(points), 3))
        for depth in depths:
            inside = points - depth * normals
            passed = np.exp(-step * np.asarray(density(ask(inside)), np.float64))
            seen += (transmittance * (1 - passed))[:, None] * colors_from(field_colors, inside, batch=batch)
            transmittance = transmittance * passed
        # Haze that stops nothing still has a colour; what shines through it is taken from the last depth.
        last = colors_from(field_colors, points - depths[-1] * normals, batch=batch)
        return np.clip(seen + transmittance[:, None] * last, 0, 1).astype(np.float32)

    return colors


def gradients(ask: Packed, points: np.ndarray, step: float) -> np.ndarray:
    """[N, 3] of the field at points [N, 3]: central differences over `step` to each side, six questions a point."""
    points = np.asarray(points, np.float64)
    sides = [ask(points + side * step * axis).astype(np.float64) for axis in np.eye(3) for side in (1, -1)]
    return np.stack([(sides[2 * i] - sides[2 * i + 1]) / (2 * step) for i in range(3)], axis=-1)


def outward(gradient: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """[N, 3] unit normals of the field, against its gradient [N, 3]; `normals` [N, 3] where the two disagree or there is no gradient."""
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    unit = -gradient / np.maximum(length, 1e-30)
    return np.where((unit * normals).sum(axis=1, keepdims=True) > GRAZING, unit, normals)


def with_normals(mesh: Mesh, surface: Surface) -> tuple[Mesh, np.ndarray]:
    """(the mesh with the field's normals, slopes [V] >= 0: how fast the field falls along them, per world unit)."""
    gradient = gradients(surface.ask, mesh.vertices, surface.cell)
    normals = outward(gradient, vertex_normals(mesh))
    slopes = np.maximum(-(gradient * normals).sum(axis=1), 0)
    return Mesh(mesh.vertices, mesh.faces, mesh.colors, normals.astype(np.float32)), slopes


def onto_surface(surface: Surface, points: np.ndarray, normals: np.ndarray, slopes: np.ndarray, reach: float) -> np.ndarray:
    """Points [N, 3] moved along their normals [N, 3] onto the level, at most `reach` world units: one Newton step by the slopes [N].

    Simplified faces cut corners; a colour asked where the face is, not where the surface is, is another one.
    """
    g = surface.ask(points).astype(np.float64) - surface.level
    move = np.where(slopes > 0, g / np.maximum(slopes, 1e-30), 0)
    return np.asarray(points + np.clip(move, -reach, reach)[:, None] * normals)

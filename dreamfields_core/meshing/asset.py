"""The way from a field to a mesh that an engine can take, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dreamfields_core.meshing.bake import bake
from dreamfields_core.meshing.color import FieldColors
from dreamfields_core.meshing.errors import MeshError
from dreamfields_core.meshing.isosurface import coarse_values, extract
from dreamfields_core.meshing.lattice import Field, Lattice, Packed, Progress, Samples
from dreamfields_core.meshing.level import Level, Views
from dreamfields_core.meshing.levels import levels_of
from dreamfields_core.meshing.pieces import drop_unseen
from dreamfields_core.meshing.report import MeshReport, report
from dreamfields_core.meshing.simplify import Simplified, check_budgets, simplify_levels
from dreamfields_core.meshing.surface import Density, Surface, SurfaceColors, just_below, through, with_normals
from dreamfields_core.meshing.unwrap import check_texture_size, unwrap
from dreamfields_core.types import Mesh

ABOVE, BELOW = 0.02, 0.2
"""Where colours that are rendered through the surface begin and end, in half-sides of the cube: a soft object's light comes from deep."""


@dataclass(frozen=True)
class Look:
    """How a mesh carries its colours.

    texture: texels a side, 256 to 4096; None for colours at vertices only. normal_map: also bake the field's normals.
    samples: of the field on the way into the object that make one colour, weighed as the renderer does; 1 takes the colour just below.
    density: raw values -> density, needed for more samples than 1.
    """

    texture: int | None = None
    normal_map: bool = False
    samples: int = 1
    density: Density | None = None


@dataclass(frozen=True)
class Asset:
    """mesh: clean, simplified, coloured, with the field's normals. details: the same with fewer faces each.
    report, detail_reports: of these. extracted: of the mesh before simplification. level: raw value of the surface; where views decided it,
    the best single one, about which the levels of different places lie.
    agreement: mean intersection over union with the views, None where the level was given. asked: points that the field was asked for.
    """

    mesh: Mesh
    report: MeshReport
    extracted: MeshReport
    level: float
    agreement: float | None
    asked: int
    details: tuple[Mesh, ...] = ()
    detail_reports: tuple[MeshReport, ...] = ()


def extract_mesh(
    field: Field,
    field_colors: FieldColors,
    *,
    level: float | None = None,
    views: Views | None = None,
    origin: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    bound: float = 1.0,
    resolution: int = 128,
    faces: int = 20_000,
    details: Sequence[int] = (),
    error: float | None = None,
    smooth: int = 0,
    look: Look = Look(),
    loose_share: float = 0.01,
    batch: int = 32768,
    timeout: float = 1800.0,
    progress: Progress | None = None,
) -> Asset:
    """Field -> level -> iso-surface -> cleaning -> simplification -> normals, charts, colours.

    field: points [N, 3] -> [N] values before activation; inside is above the level. field_colors: points [N, 3] -> [N, 3] in [0, 1].
    Both are always asked for `batch` points. level: raw, as the field gives it; without one, `views` decide it.
    faces, details, error, smooth, loose_share: see `simplify_levels`; details are the budgets of the lighter meshes, each with a texture
    of half the side of the one before. progress: told the points asked so far.

    Raises:
      MeshError: one of its kinds in `errors`; bad settings before the field is asked.
    """
    budgets = (faces, *details)
    check_budgets(budgets, error=error, smooth=smooth)
    check_look(look)
    if level is None and views is None:
        raise MeshError("expected a level or the views to choose it by, got neither: pass one of them")
    x, y, z = (float(value) for value in origin)
    lattice = Lattice((x, y, z), bound, resolution)
    ask = Packed(field, batch=batch, progress=progress)
    samples = Samples(lattice, ask)
    coarse = coarse_values(samples)
    chosen, above = _chosen(level, views, coarse, lattice)
    samples = samples.above(above)
    extracted = extract(samples, coarse_values(samples), 0.0)
    shown = extracted if views is None else drop_unseen(extracted, views)
    simple = simplify_levels(shown, budgets, error=error, smooth=smooth, loose_share=loose_share, timeout=timeout)
    surface = Surface(samples.ask, 0.0, lattice.cell, _colors(ask, field_colors, look, lattice, batch))
    mesh, *lighter = (_dressed(simplified, surface, look, halvings=k, timeout=timeout) for k, simplified in enumerate(simple))
    counts, *lighter_counts = (report(simplified.mesh, crossing=simplified.crossing) for simplified in simple)
    return Asset(
        mesh=mesh,
        report=counts,
        extracted=report(extracted),
        level=chosen.value,
        agreement=None if level is not None else chosen.agreement,
        asked=samples.ask.asked,
        details=tuple(lighter),
        detail_reports=tuple(lighter_counts),
    )


def _chosen(level: float | None, views: Views | None, coarse: np.ndarray, lattice: Lattice) -> tuple[Level, Field]:
    """The level, and the same for every place: points [N, 3] -> [N]."""
    if level is not None:
        return Level(level, float("nan")), lambda points: np.full(len(points), level, np.float32)
    assert views is not None
    return levels_of(views, coarse, lattice)


def check_look(look: Look) -> None:
    """Raises MeshError for a texture that cannot be, and for a normal map or samples that have nothing to work with."""
    if look.texture is not None:
        check_texture_size(look.texture)
    elif look.normal_map:
        raise MeshError("expected a texture for the normal map to lie beside, got none: set mesh.texture to 1024")
    if look.samples < 1 or (look.samples > 1 and look.density is None):
        raise MeshError(f"expected 1 sample a colour, or more and the field's density, got {look.samples}: set mesh.color_samples to 1")


def _colors(ask: Packed, field_colors: FieldColors, look: Look, lattice: Lattice, batch: int) -> SurfaceColors:
    if look.density is None or look.samples == 1:
        return just_below(field_colors, inset=lattice.cell / 2, batch=batch)
    above, below = ABOVE * lattice.bound, BELOW * lattice.bound
    return through(ask, field_colors, look.density, above=above, below=below, samples=look.samples, batch=batch)


def _dressed(simplified: Simplified, surface: Surface, look: Look, *, halvings: int, timeout: float) -> Mesh:
    """With the field's normals, its colours at vertices, and its texture."""
    mesh, slopes = with_normals(simplified.mesh, surface)
    assert mesh.normals is not None
    mesh = replace(mesh, colors=surface.colors(mesh.vertices, mesh.normals))
    if look.texture is None:
        return mesh
    size = max(256, look.texture >> halvings)
    flat, source = unwrap(mesh, size, timeout=timeout)
    return replace(flat, texture=bake(flat, slopes[source], surface, size, normal_map=look.normal_map))

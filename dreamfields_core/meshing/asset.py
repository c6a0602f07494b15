"""The way from a field to a mesh that an engine can take, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dreamfields_core.meshing.color import FieldColors, with_colors
from dreamfields_core.meshing.errors import MeshError
from dreamfields_core.meshing.isosurface import coarse_values, extract
from dreamfields_core.meshing.lattice import Field, Lattice, Packed, Progress, Samples
from dreamfields_core.meshing.level import Level, Views, level_of
from dreamfields_core.meshing.report import MeshReport, report
from dreamfields_core.meshing.simplify import check_budget, simplify
from dreamfields_core.types import Mesh


@dataclass(frozen=True)
class Asset:
    """mesh: clean, simplified, coloured. report: of that mesh. extracted: of the mesh before simplification.
    level: raw value of the surface. agreement: mean intersection over union with the views, None where the level was given.
    asked: points that the field was asked for.
    """

    mesh: Mesh
    report: MeshReport
    extracted: MeshReport
    level: float
    agreement: float | None
    asked: int


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
    loose_share: float = 0.01,
    batch: int = 32768,
    timeout: float = 300.0,
    progress: Progress | None = None,
) -> Asset:
    """Field -> level -> iso-surface -> cleaning -> simplification -> colours.

    field: points [N, 3] -> [N] values before activation; inside is above the level. field_colors: points [N, 3] -> [N, 3] in [0, 1].
    Both are always asked for `batch` points. level: raw, as the field gives it; without one, `views` decide it.
    faces: budget. loose_share: pieces below this share of the largest one's area go. progress: told the points asked so far.

    Raises:
      MeshError: one of its kinds in `errors`; bad settings before the field is asked.
    """
    check_budget(faces)
    if level is None and views is None:
        raise MeshError("expected a level or the views to choose it by, got neither: pass one of them")
    x, y, z = (float(value) for value in origin)
    lattice = Lattice((x, y, z), bound, resolution)
    samples = Samples(lattice, Packed(field, batch=batch, progress=progress))
    coarse = coarse_values(samples)
    chosen = Level(level, float("nan")) if level is not None else level_of(views, coarse, lattice)  # type: ignore[arg-type]
    surface = extract(samples, coarse, chosen.value)
    simple = simplify(surface, faces, loose_share=loose_share, timeout=timeout)
    mesh = with_colors(simple, field_colors, inset=lattice.cell / 2, batch=batch)
    return Asset(
        mesh=mesh,
        report=report(mesh),
        extracted=report(surface),
        level=chosen.value,
        agreement=None if level is not None else chosen.agreement,
        asked=samples.ask.asked,
    )

"""What is made of a finished field: held-out views, their judge, and the mesh (paper section 5.1)."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from dreamfields_core.config.parts import Count, Finite, Part, Positive


class EvaluateConfig(Part):
    """The held-out views (paper section 5.1): white background, no crop, no jitter; then the judge.

    azimuths: of the scored views, the first is the paper's. size: None means the judge's own input size.
    pool: captions to retrieve among, the true one included. picture_size: of the contact sheet's and turntable's views.
    """

    azimuths: Annotated[tuple[Finite, ...], Field(min_length=1)] = (30.0, 120.0, 210.0, 300.0)
    elevation: Finite = 45.0
    radius: Positive = 4.0
    focal: Positive = 1111.1111 / 800
    samples: Count = 512
    size: Count | None = None
    judge: Annotated[str, Field(min_length=1)] = "embedded-judge"
    pool: Annotated[int, Field(ge=2)] = 153
    picture_size: Count = 256
    turntable_frames: Count = 36


def coarse_cells(resolution: int) -> int:
    """Cells a side of the lattice that is asked whole, before the surface is refined: halved while that leaves at least 64."""
    while resolution % 2 == 0 and resolution >= 128:
        resolution //= 2
    return resolution


class MeshConfig(Part):
    """resolution: cells a side of the finest lattice. level: density of the surface; None chooses the one whose silhouettes agree best
    with the field's opacity. faces: budget after simplification. error: world units; given, fewer faces still, as long as the surface moves
    no further. details: budgets of lighter meshes beside it, falling. smooth: rounds of smoothing before.
    texture: texels a side, None for colours at vertices only. normal_map: baked beside the colours. color_samples: of the field on the
    way into the object that make one colour, weighed as the renderer does; 1 takes the colour just below the surface.
    """

    resolution: Annotated[int, Field(ge=16, le=1024)] = 128
    level: Positive | None = None
    faces: Annotated[int, Field(ge=4)] = 20_000
    error: Positive | None = None
    details: tuple[Annotated[int, Field(ge=4)], ...] = ()
    smooth: Annotated[int, Field(ge=0, le=100)] = 0
    texture: Annotated[int, Field(ge=256, le=4096)] | None = 1024
    normal_map: bool = False
    color_samples: Annotated[int, Field(ge=1, le=64)] = 1

    @field_validator("resolution")
    @classmethod
    def _can_be_refined(cls, resolution: int) -> int:
        """The lattice that is asked whole may have 128 cells a side at most. Better told before the dream."""
        if coarse_cells(resolution) > 128:
            raise ValueError(f"expected at most 128 cells a side or a multiple of 64, got {resolution}: take {-(-resolution // 64) * 64}")
        return resolution

    @model_validator(mode="after")
    def _fits_together(self) -> MeshConfig:
        budgets = (self.faces, *self.details)
        if any(later >= earlier for earlier, later in pairwise(budgets)):
            raise ValueError(f"expected details that fall from mesh.faces, got {list(budgets)}: give each level fewer faces")
        if self.normal_map and self.texture is None:
            raise ValueError("expected a texture beside the normal map, got none: set mesh.texture=1024 or mesh.normal_map=false")
        return self

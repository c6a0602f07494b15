"""What is made of a finished field: held-out views, their judge, and the mesh (paper section 5.1)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

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


class MeshConfig(Part):
    """resolution: cells a side of the finest lattice. faces: budget after simplification. level: density of the surface;
    None chooses the one whose silhouettes agree best with the field's opacity."""

    resolution: Annotated[int, Field(ge=16, le=1024)] = 128
    faces: Annotated[int, Field(ge=4)] = 20_000
    level: Positive | None = None

"""The kinds of field, each with its own settings."""

from __future__ import annotations

import math
from typing import Annotated, Literal, get_args

from pydantic import Field, field_validator, model_validator

from dreamfields_core.config.parts import Count, Finite, NonNegative, Part, Positive, Share


class EncodingConfig(Part):
    """How a position comes into a network (paper section 3.1 and appendix C), after the position itself.

    fourier: `frequencies` random directions of 1 to 2^levels radians a unit; False: along the axes, 2^l for l < levels.
    integrated: averaged over the footprint of a sample (mip-NeRF); False: at its middle.
    """

    frequencies: Count = 128
    levels: Positive = 8.0
    fourier: bool = True
    integrated: bool = True

    @model_validator(mode="after")
    def whole_octaves(self) -> EncodingConfig:
        if not self.fourier and self.levels != round(self.levels):
            raise ValueError(f"expected a whole number of levels along the axes, got {self.levels}: set field.fourier=true for others")
        return self


class ResidualMLPConfig(EncodingConfig):
    """The paper's network (section 4.7): the encoding into residual blocks."""

    kind: Literal["residual_mlp"] = "residual_mlp"
    width: Count = 128
    bottleneck: Count = 256
    blocks: Count = 4


class NeRFMLPConfig(EncodingConfig):
    """The plain network of NeRF, the paper's baseline (table 1): layers of even width with ReLU, the encoding again in the middle."""

    kind: Literal["nerf_mlp"] = "nerf_mlp"
    levels: Positive = 6.0
    fourier: bool = False
    integrated: bool = False
    width: Count = 256
    depth: Count = 8


class SignedDistanceConfig(EncodingConfig):
    """A signed distance, from which density follows (paper appendix E, VolSDF): a ball, bent by the paper's network.

    radius: of the ball that it starts from, world units.
    softness: beta that it starts from, the width of the surface in world units; learned from there.
    eikonal: weight of the loss that keeps the slope of the distance at 1. eikonal_points: where it is asked, a step.
    """

    kind: Literal["signed_distance"] = "signed_distance"
    levels: Positive = 5.0
    width: Count = 128
    bottleneck: Count = 256
    blocks: Count = 4
    radius: Positive = 0.4
    softness: Positive = 0.1
    eikonal: NonNegative = 0.1
    eikonal_points: Count = 1024


class VoxelGridConfig(Part):
    """Raw density and colour logits at the vertices of one grid, without a network (the paper's baseline, appendix D).

    resolution: vertices a side.
    empty: raw density that the grid starts from. spread: standard deviation of the numbers that it starts from.
    density_scale: density is this times the softplus of the raw value. At the default, a sample of the paper's (192 along the
    diagonal of a cube of half-side 1) has opacity sigmoid(raw), as the baseline's voxels do.
    smoothness: weight of the total variation of the raw density.
    """

    kind: Literal["voxel_grid"] = "voxel_grid"
    resolution: Annotated[int, Field(ge=2, le=512)] = 128
    empty: Finite = -4.0
    spread: NonNegative = 0.0
    density_scale: Positive = 192 / (2 * math.sqrt(3))
    smoothness: NonNegative = 0.1


class ImagePlaneConfig(Part):
    """A picture with opacity that faces one camera (the paper's baseline, appendix D); from elsewhere a thin sheet is seen.

    azimuth, elevation, radius: of the camera that it faces, as in `camera`; degrees, world units. It fills that camera's view
    if `camera` is fixed there and `extent` is half the radius over the focal length.
    resolution: pixels a side. extent: half-side of the picture where it passes through the world's zero, world units.
    thickness: standard deviation of the sheet's profile, world units; how opaque a pixel is does not depend on it.
    empty: logit of the opacity that it starts from. spread: standard deviation of the numbers that it starts from.
    smoothness: weight of the total variation of the picture.
    """

    kind: Literal["image_plane"] = "image_plane"
    azimuth: Finite = 0.0
    elevation: Finite = 30.0
    radius: Positive = 4.0
    resolution: Annotated[int, Field(ge=2, le=2048)] = 168
    extent: Positive = 1.2
    thickness: Positive = 0.04
    empty: Finite = -1.0
    spread: NonNegative = 0.1
    smoothness: NonNegative = 0.1


class HybridConfig(Part):
    """Feature grids of several resolutions and a small network, as the paper's appendix D proposes.

    resolutions: cells a side of each grid, coarse to fine.
    falloff: weight of each grid relative to the one before.
    features: numbers stored at each vertex.
    width, depth: of the network that reads them; depth 0 stores raw density and colour logits themselves.
    blob, empty: raw density that the field starts from at the centre and far from it.
    blob_radius: standard deviation of that initial ball, world units.
    spread: standard deviation of the initial features.
    density_scale: density is this times the softplus of the raw value.
    smoothness: weight of the total variation of the grids in the loss.
    """

    kind: Literal["hybrid"] = "hybrid"
    resolutions: Annotated[tuple[Count, ...], Field(min_length=1)] = (6, 12, 24, 40)
    falloff: Share = 0.7
    features: Count = 8
    width: Count = 32
    depth: Annotated[int, Field(ge=0)] = 1
    blob: Finite = 0.0
    empty: Finite = -9.0
    blob_radius: Positive = 0.5
    spread: NonNegative = 0.05
    density_scale: Positive = 20.0
    smoothness: NonNegative = 0.02

    @field_validator("resolutions")
    @classmethod
    def _once_each(cls, resolutions: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(resolutions)) < len(resolutions):
            raise ValueError(f"expected every resolution once, got {list(resolutions)}: take {sorted(set(resolutions))}")
        return resolutions


AnyField = ResidualMLPConfig | NeRFMLPConfig | HybridConfig | VoxelGridConfig | SignedDistanceConfig | ImagePlaneConfig

FieldConfig = Annotated[AnyField, Field(discriminator="kind")]

FIELD_KINDS: tuple[str, ...] = tuple(config.model_fields["kind"].default for config in get_args(AnyField))
"""What `field.kind` may be."""

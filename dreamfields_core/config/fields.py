"""The kinds of field, each with its own settings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from dreamfields_core.config.parts import Count, Finite, NonNegative, Part, Positive, Share


class ResidualMLPConfig(Part):
    """The paper's network (section 4.6): integrated random Fourier features into residual blocks."""

    kind: Literal["residual_mlp"] = "residual_mlp"
    frequencies: Count = 128
    levels: Positive = 8.0
    width: Count = 128
    bottleneck: Count = 256
    blocks: Count = 4


class HybridConfig(Part):
    """Feature grids of several resolutions and a small network, as the paper's appendix B proposes.

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


FieldConfig = Annotated[ResidualMLPConfig | HybridConfig, Field(discriminator="kind")]

"""Training pictures, and what of a scene is not computed for them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from dreamfields_core.config.parts import Count, NonNegative, Part, PositiveShare, Share


class SkipConfig(Part):
    """What a scene does not need and the renderer leaves out; every saving can be switched off.

    enabled: False evaluates every sample of every ray (the dense path).
    resolution: cells a side of the occupancy grid.
    warmup_steps: steps at the start that evaluate every sample inside the cube.
    refresh_every: steps between refreshes of the grid.
    refresh_turns: a refresh asks one cell in so many, others each time; the first one asks all. Divides the resolution.
    decay: of the running maximum of density in a cell, per refresh.
    threshold: a cell counts as empty below this optical depth a step length.
    explore: share of the samples in empty cells that is evaluated all the same, weighted up so that expectations hold.
    terminate: transmittance below which nothing further along the ray is evaluated.
    learn: at most this share of the evaluated samples is expected to carry the gradient on into the field's parameters; drawn by how much
    each matters, weighted up so that expectations hold.
    refine: fine steps in a coarse one, in pictures of a finished field; only steps that a first, coarse pass finds worth it are fine.
    1 takes every step fine at once.
    chunk: samples evaluated at once; bounds the memory, not the result. null takes what suits the device: few on a CPU, whose caches are
    small and whose last chunk is seldom full, many elsewhere.
    """

    enabled: bool = True
    resolution: Count = 32
    warmup_steps: Annotated[int, Field(ge=0)] = 64
    refresh_every: Count = 16
    refresh_turns: Count = 1
    decay: Share = 0.9
    threshold: NonNegative = 1e-3
    explore: PositiveShare = 0.02
    terminate: Share = 1e-4
    learn: PositiveShare = 1.0
    refine: Count = 1
    chunk: Count | None = None

    @model_validator(mode="after")
    def turns_fit(self) -> SkipConfig:
        if self.resolution % self.refresh_turns:
            raise ValueError(
                f"expected render.skip.refresh_turns to divide render.skip.resolution, got {self.refresh_turns} and {self.resolution}"
            )
        return self


class RenderConfig(Part):
    """Training pictures.

    size: side in pixels. crop: side of the random crop that the encoder sees, at most size.
    samples: how many step lengths fit along the cube's diagonal.
    products: factors of the field's large matrix products while it is optimised; "auto" takes bfloat16 where the device is faster
    for it (GPU, TPU) and float32 elsewhere. Everything else is float32 always.
    devices: how many share the rays of a step; null takes all of this machine if their number divides that of the rays, else one.
    """

    size: Count = 168
    crop: Count = 154
    samples: Count = 192
    products: Literal["auto", "float32", "bfloat16"] = "auto"
    devices: Count | None = None
    skip: SkipConfig = SkipConfig()

    @model_validator(mode="after")
    def crop_fits(self) -> RenderConfig:
        if self.crop > self.size:
            raise ValueError(f"expected render.crop <= render.size, got crop={self.crop} and size={self.size}")
        return self

"""What decides a dream: one small frozen part for each concern, validated as a whole.

The same definition serves the command line, the form of a deployment, the cache keys and the record of a run. A step of the
pipeline reads only the parts it names, so that changing the mesh leaves the optimised field cached.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
PositiveShare = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]


class Part(BaseModel):
    """Frozen; a key it does not know is refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Range(Part):
    """A closed interval to draw from uniformly; low = high means fixed."""

    low: Finite
    high: Finite

    @model_validator(mode="after")
    def ordered(self) -> Range:
        if self.low > self.high:
            raise ValueError(f"expected low <= high, got low={self.low} and high={self.high}")
        return self


class SceneConfig(Part):
    """Where the object may be (paper section 4.5).

    bound: half-side of the cube outside of which density is zero.
    track_origin: follow the centre of mass of the density.
    origin_decay: of the moving average that follows it, per step.
    """

    bound: Positive = 1.0
    track_origin: bool = True
    origin_decay: Share = 0.999


class CameraConfig(Part):
    """Poses drawn in training (paper section 4.3); angles in degrees, radius in world units, focal in image widths.

    views: poses a step; their azimuths are drawn evenly spaced with a common random turn and an own jitter of half a gap.
    """

    azimuth: Range = Range(low=0.0, high=360.0)
    elevation: Range = Range(low=30.0, high=30.0)
    radius: Range = Range(low=4.0, high=4.0)
    focal: Range = Range(low=1.2 * 1111.1111 / 800, high=1.2 * 1111.1111 / 800)
    views: Count = 1

    @model_validator(mode="after")
    def in_front(self) -> CameraConfig:
        for name, interval in (("radius", self.radius), ("focal", self.focal)):
            if interval.low <= 0:
                raise ValueError(f"expected camera.{name}.low > 0, got {interval.low}")
        return self


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


class SkipConfig(Part):
    """What a scene does not need and the renderer leaves out; every saving can be switched off.

    enabled: False evaluates every sample of every ray (the dense path).
    resolution: cells a side of the occupancy grid.
    warmup_steps: steps at the start that evaluate every sample inside the cube.
    refresh_every: steps between refreshes of the grid.
    decay: of the running maximum of optical depth in a cell, per refresh.
    threshold: a cell counts as empty below this optical depth a step length.
    explore: share of the samples in empty cells that is evaluated all the same, weighted up so that expectations hold.
    terminate: transmittance below which nothing further along the ray is evaluated.
    chunk: samples evaluated at once; bounds the memory, not the result.
    """

    enabled: bool = True
    resolution: Count = 32
    warmup_steps: Annotated[int, Field(ge=0)] = 64
    refresh_every: Count = 16
    decay: Share = 0.9
    threshold: NonNegative = 1e-3
    explore: PositiveShare = 0.02
    terminate: Share = 1e-4
    chunk: Count = 16384


class RenderConfig(Part):
    """Training pictures.

    size: side in pixels. crop: side of the random crop that the encoder sees, at most size.
    samples: how many step lengths fit along the cube's diagonal.
    """

    size: Count = 168
    crop: Count = 154
    samples: Count = 192
    skip: SkipConfig = SkipConfig()

    @model_validator(mode="after")
    def crop_fits(self) -> RenderConfig:
        if self.crop > self.size:
            raise ValueError(f"expected render.crop <= render.size, got crop={self.crop} and size={self.size}")
        return self


Background = Literal["noise", "checkerboard", "fourier", "solid", "white"]


class AugmentConfig(Part):
    """Backgrounds behind the object in training (paper section 4.4), drawn evenly from the kinds named.

    copies: augmented copies of every view.
    blur: largest standard deviation of the Gaussian blur of the background, pixels.
    checkers: squares a side of the checkerboard.
    """

    backgrounds: Annotated[tuple[Background, ...], Field(min_length=1)] = ("noise", "checkerboard", "fourier")
    blur: NonNegative = 10.0
    checkers: Count = 8
    copies: Count = 8


class GuidanceConfig(Part):
    """The image-text model that the field is optimised with."""

    name: Annotated[str, Field(min_length=1)] = "embedded"


class LossConfig(Part):
    """Clipped additive transmittance loss (paper equations 5 and 6).

    transmittance: weight lambda. opacity_start -> opacity_end: target mean opacity, annealed geometrically over anneal_steps,
    then times m^2 / 1.2 / (radius / 4)^2 with focal = m x 1111.1/800: the area that the object fills in the picture stays its own.
    """

    transmittance: NonNegative = 0.5
    opacity_start: PositiveShare = 0.5
    opacity_end: PositiveShare = 0.1
    anneal_steps: Count = 500


class OptimConfig(Part):
    """Adam (paper appendix C): rate_start -> rate geometrically over warmup_steps, then constant or to rate_end by a cosine.

    checkpoint_every: steps between checkpoints.
    patience: bad steps (non-finite loss or gradient) in a row before the run goes back to its last checkpoint with half the rate.
    """

    steps: Count = 10_000
    rate_start: Positive = 1e-5
    rate: Positive = 1e-4
    warmup_steps: Annotated[int, Field(ge=0)] = 1500
    rate_end: Positive | None = None
    epsilon: Positive = 1e-5
    checkpoint_every: Count = 500
    patience: Count = 5


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


class DreamConfig(Part):
    """All that decides a dream besides its caption."""

    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    scene: SceneConfig = SceneConfig()
    camera: CameraConfig = CameraConfig()
    field: FieldConfig = ResidualMLPConfig()
    render: RenderConfig = RenderConfig()
    augment: AugmentConfig = AugmentConfig()
    guidance: GuidanceConfig = GuidanceConfig()
    loss: LossConfig = LossConfig()
    optim: OptimConfig = OptimConfig()
    evaluate: EvaluateConfig = EvaluateConfig()
    mesh: MeshConfig = MeshConfig()

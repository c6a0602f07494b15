"""How the field is moved toward the caption (paper sections 3.2, 4.2 and 4.5, appendix C)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from dreamfields_core.config.parts import Count, NonNegative, Part, Positive, PositiveShare

Background = Literal["noise", "checkerboard", "fourier", "solid", "white"]
Regularizer = Literal["none", "density_noise", "beta_prior", "gated", "clipped_gated", "clipped_additive"]


class AugmentConfig(Part):
    """Backgrounds behind the object in training (paper section 4.5), drawn evenly from the kinds named.

    copies: augmented copies of every view.
    blur: largest standard deviation of the Gaussian blur of the background, pixels.
    checkers: squares a side of the checkerboard.
    """

    backgrounds: Annotated[tuple[Background, ...], Field(min_length=1)] = ("noise", "checkerboard", "fourier")
    blur: NonNegative = 10.0
    checkers: Count = 8
    copies: Count = 8


class GuidanceConfig(Part):
    """The image-text model that the field is optimised with, and what it is told.

    captions: the caption alone (plain), or with the side that each camera sees appended to it (views).
    templates: wordings with {} where the caption goes; the mean of their embeddings is what pictures are compared with.
    """

    name: Annotated[str, Field(min_length=1)] = "embedded"
    captions: Literal["plain", "views"] = "plain"
    templates: Annotated[tuple[str, ...], Field(min_length=1)] = ("{}",)

    @field_validator("templates")
    @classmethod
    def hold_the_caption(cls, templates: tuple[str, ...]) -> tuple[str, ...]:
        """Raises: ValueError."""
        for template in templates:
            if "{}" not in template:
                raise ValueError(f'expected wordings with {{}} where the caption goes, got "{template[:60]}": write "a photo of {{}}"')
        return templates


class LossConfig(Part):
    """What keeps a scene sparse (paper section 4.5 and table 2), and how sparse it shall be.

    regularizer: clipped_additive is the paper's own (equations 8 and 9); none, density_noise, beta_prior, gated and clipped_gated are
    those that it is compared with (table 2).
    transmittance: weight lambda of clipped_additive. beta: weight of beta_prior.
    noise_start -> noise_end: standard deviation of density_noise, added to the raw density, annealed evenly over noise_steps.
    opacity_start -> opacity_end: target mean opacity, annealed geometrically over anneal_steps,
    then times m^2 / 1.2 / (radius / 4)^2 with focal = m x 1111.1/800: the area that the object fills in the picture stays its own.
    """

    regularizer: Regularizer = "clipped_additive"
    transmittance: NonNegative = 0.5
    beta: NonNegative = 1e-3
    noise_start: NonNegative = 1.0
    noise_end: NonNegative = 1.0
    noise_steps: Count = 10_000
    opacity_start: PositiveShare = 0.5
    opacity_end: PositiveShare = 0.1
    anneal_steps: Count = 500


class OptimConfig(Part):
    """Adam (paper appendix C): rate_start -> rate geometrically over warmup_steps, then constant or to rate_end by a cosine.

    checkpoint_every: steps between checkpoints.
    patience: bad steps (non-finite loss or gradient) in a row before the run goes back to its last checkpoint with half the rate.
    settle_window, settle_gain: the run ends early once the mean similarity of a window of so many steps is less than the gain above
    that of the window before, both after warm-up and annealing; a window of null takes all steps.
    """

    steps: Count = 10_000
    rate_start: Positive = 1e-5
    rate: Positive = 1e-4
    warmup_steps: Annotated[int, Field(ge=0)] = 1500
    rate_end: Positive | None = None
    epsilon: Positive = 1e-5
    checkpoint_every: Count = 500
    patience: Count = 5
    settle_window: Count | None = None
    settle_gain: NonNegative = 1e-3

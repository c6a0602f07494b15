"""Where the object may be and from where it is seen (paper sections 4.4 and 4.6)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from dreamfields_core.config.parts import Count, Part, Positive, Range, Share

FARTHEST = 1000.0
"""Radius and focal length beyond which there is less than a pixel of an object, or no more than a pixel's width of it."""


class SceneConfig(Part):
    """Where the object may be (paper section 4.6).

    bound: half-side of the cube outside of which density is zero, world units. There is always a cube; one of 1.8 holds all that the
    paper's camera sees, and masks nothing in its view.
    track_origin: follow the centre of mass of the density.
    origin_decay: of the moving average that follows it, per step.
    """

    bound: Annotated[Positive, Field(ge=0.01, le=100)] = 1.0
    track_origin: bool = True
    origin_decay: Share = 0.999


class CameraConfig(Part):
    """Poses drawn in training (paper section 4.4); angles in degrees, radius in world units, focal in image widths.

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
            if interval.high > FARTHEST:
                raise ValueError(f"expected camera.{name}.high <= {FARTHEST:g}, got {interval.high}")
        if max(abs(self.elevation.low), abs(self.elevation.high)) > 90:
            raise ValueError(f"expected camera.elevation within -90 and 90, got {self.elevation.low} to {self.elevation.high}")
        return self

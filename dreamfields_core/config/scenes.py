"""Where the object may be and from where it is seen (paper sections 4.3 and 4.5)."""

from __future__ import annotations

from pydantic import model_validator

from dreamfields_core.config.parts import Count, Part, Positive, Range, Share


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

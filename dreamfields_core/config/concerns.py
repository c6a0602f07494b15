"""What decides a dream: one small frozen part for each concern, validated as a whole.

The same definition serves the command line, the form of a deployment, the cache keys and the record of a run. A step of the
pipeline reads only the parts it names, so that changing the mesh leaves the optimised field cached.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from dreamfields_core.config.dreams import AugmentConfig, GuidanceConfig, LossConfig, OptimConfig
from dreamfields_core.config.fields import FieldConfig, ResidualMLPConfig
from dreamfields_core.config.parts import Part
from dreamfields_core.config.renders import RenderConfig
from dreamfields_core.config.results import EvaluateConfig, MeshConfig
from dreamfields_core.config.scenes import CameraConfig, SceneConfig


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

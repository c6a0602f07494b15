"""What decides a dream, and how its settings are read and refused."""

from dreamfields_core.config.concerns import DreamConfig
from dreamfields_core.config.dreams import AugmentConfig, Background, GuidanceConfig, LossConfig, OptimConfig
from dreamfields_core.config.fields import (
    EncodingConfig,
    FieldConfig,
    HybridConfig,
    ImagePlaneConfig,
    NeRFMLPConfig,
    ResidualMLPConfig,
    SignedDistanceConfig,
    VoxelGridConfig,
)
from dreamfields_core.config.parts import Part, Range
from dreamfields_core.config.renders import RenderConfig, SkipConfig
from dreamfields_core.config.results import EvaluateConfig, MeshConfig
from dreamfields_core.config.scenes import CameraConfig, SceneConfig
from dreamfields_core.config.settings import ConfigError, override, parts, validate

__all__ = [
    "AugmentConfig",
    "Background",
    "CameraConfig",
    "ConfigError",
    "DreamConfig",
    "EncodingConfig",
    "EvaluateConfig",
    "FieldConfig",
    "GuidanceConfig",
    "HybridConfig",
    "ImagePlaneConfig",
    "LossConfig",
    "MeshConfig",
    "NeRFMLPConfig",
    "OptimConfig",
    "Part",
    "Range",
    "RenderConfig",
    "ResidualMLPConfig",
    "SceneConfig",
    "SignedDistanceConfig",
    "SkipConfig",
    "VoxelGridConfig",
    "override",
    "parts",
    "validate",
]

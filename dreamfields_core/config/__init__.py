"""What decides a dream, and how its settings are read and refused."""

from dreamfields_core.config.concerns import DreamConfig
from dreamfields_core.config.dreams import AugmentConfig, Background, GuidanceConfig, LossConfig, OptimConfig
from dreamfields_core.config.fields import FieldConfig, HybridConfig, ResidualMLPConfig
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
    "EvaluateConfig",
    "FieldConfig",
    "GuidanceConfig",
    "HybridConfig",
    "LossConfig",
    "MeshConfig",
    "OptimConfig",
    "Part",
    "Range",
    "RenderConfig",
    "ResidualMLPConfig",
    "SceneConfig",
    "SkipConfig",
    "override",
    "parts",
    "validate",
]

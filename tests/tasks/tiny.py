"""The smallest dream that goes the whole way."""

from __future__ import annotations

from dreamfields_core.config import DreamConfig, override
from dreamfields_core.presets import preset

SETTINGS = (
    "field.resolutions=[6,12]",
    "camera.views=2",
    "render.size=16",
    "render.crop=14",
    "render.samples=16",
    "render.skip.warmup_steps=4",
    "render.skip.refresh_every=2",
    "render.skip.resolution=16",
    "optim.steps=12",
    "optim.checkpoint_every=4",
    "evaluate.samples=24",
    "evaluate.size=16",
    "evaluate.picture_size=32",
    "evaluate.turntable_frames=4",
    "mesh.resolution=32",
    "mesh.faces=800",
    "mesh.texture=256",
)


def tiny(*settings: str) -> DreamConfig:
    """A configuration of seconds."""
    return override(preset("draft"), (*SETTINGS, *settings))

"""Named configurations: `draft` for a first look on two CPU cores, and the paper's three sizes."""

from __future__ import annotations

from dreamfields_core.config import (
    AugmentConfig,
    CameraConfig,
    ConfigError,
    DreamConfig,
    EvaluateConfig,
    HybridConfig,
    LossConfig,
    MeshConfig,
    OptimConfig,
    Range,
    RenderConfig,
    SceneConfig,
    SkipConfig,
)


def _paper(*, size: int, crop: int, steps: int) -> DreamConfig:
    return DreamConfig(
        # A sample of the paper's network costs enough for a finer memory of where the scene is, and for learning from a tenth.
        render=RenderConfig(size=size, crop=crop, skip=SkipConfig(resolution=64, refresh_turns=8, learn=0.1)),
        optim=OptimConfig(steps=steps),
        mesh=MeshConfig(resolution=256),
        evaluate=EvaluateConfig(),
    )


DRAFT = DreamConfig(
    # The grids stay where they are, so the cube around them does too.
    scene=SceneConfig(track_origin=False),
    field=HybridConfig(),
    camera=CameraConfig(elevation=Range(low=15.0, high=40.0), views=3),
    # Every chunk's gradient goes over the whole grid once: few chunks, and little to gain from learning from fewer samples.
    render=RenderConfig(size=48, crop=44, samples=48, skip=SkipConfig(warmup_steps=24, refresh_every=8, chunk=16384)),
    augment=AugmentConfig(copies=2, blur=3.0),
    loss=LossConfig(anneal_steps=150, opacity_end=0.14),
    optim=OptimConfig(steps=300, rate_start=3e-2, rate=3e-2, warmup_steps=0, rate_end=3e-3, checkpoint_every=50),
    evaluate=EvaluateConfig(samples=128, turntable_frames=24),
    mesh=MeshConfig(resolution=128),
)

PRESETS: dict[str, DreamConfig] = {
    "draft": DRAFT,
    "low": _paper(size=88, crop=80, steps=10_000),
    "medium": _paper(size=168, crop=154, steps=10_000),
    "high": _paper(size=252, crop=224, steps=20_000),
}


def preset(name: str) -> DreamConfig:
    """The configuration of that name.

    Raises:
      ConfigError: no such preset.
    """
    if name not in PRESETS:
        raise ConfigError(f'expected a preset among {", ".join(PRESETS)}, got "{name}"')
    return PRESETS[name]

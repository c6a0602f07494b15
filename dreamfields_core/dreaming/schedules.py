"""What changes as a dream goes on: the learning rate and the target transmittance."""

from __future__ import annotations

import jax.numpy as jnp

from dreamfields_core.config import LossConfig, OptimConfig
from dreamfields_core.scene.cameras import FOCAL_UNIT, Pose
from dreamfields_core.types import Array

PAPER_FOCAL = 1.2
"""m_focal of the paper, at which its target transmittances are stated."""

PAPER_RADIUS = 4.0


def geometric(step: Array, *, start: float, end: float, steps: int) -> Array:
    """From start to end by equal factors over `steps`, then end; start and end > 0."""
    share = jnp.clip(step / max(steps, 1), 0.0, 1.0) if steps else jnp.ones(())
    return start * (end / start) ** share


def density_noise(step: Array, loss: LossConfig) -> Array:
    """Standard deviation of what is added to the raw density: noise_start -> noise_end in even steps, then noise_end; []."""
    share = jnp.clip(step / loss.noise_steps, 0.0, 1.0)
    return loss.noise_start + (loss.noise_end - loss.noise_start) * share


def learning_rate(step: Array, optim: OptimConfig) -> Array:
    """Geometric warm-up (paper appendix C), then constant, or to rate_end along half a cosine."""
    warm = geometric(step, start=optim.rate_start, end=optim.rate, steps=optim.warmup_steps)
    if optim.rate_end is None:
        return warm
    share = jnp.clip((step - optim.warmup_steps) / max(optim.steps - optim.warmup_steps, 1), 0.0, 1.0)
    settled = optim.rate_end + (optim.rate - optim.rate_end) * 0.5 * (1.0 + jnp.cos(jnp.pi * share))
    return jnp.where(step < optim.warmup_steps, warm, settled)


def target_transmittance(step: Array, pose: Pose, loss: LossConfig) -> Array:
    """tau of paper equation 8 for each pose, [...]: 1 - tau is annealed and scales with focal^2 / radius^2.

    At the paper's camera this runs from 0.4 to 0.88.
    """
    opacity = geometric(step, start=loss.opacity_start, end=loss.opacity_end, steps=loss.anneal_steps)
    area = (pose.focal / FOCAL_UNIT) ** 2 / PAPER_FOCAL / (pose.radius / PAPER_RADIUS) ** 2
    return jnp.clip(1.0 - opacity * area, 0.0, 1.0)

"""A scene whose every ray is known: a ball of even density whose edge is a step or a smooth curve."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import nn

from dreamfields_core.fields.contract import Field
from dreamfields_core.types import Array, Gaussians, Params

COLORS = ((0.9, 0.5, 0.1), (0.1, 0.3, 0.8))
"""At the top of the ball and at its bottom, straight between: colour has an integral of its own to get right."""


def ball(*, radius: float, softness: float) -> Field:
    """Density `prepared["density"]` inside; the edge is a logistic curve of width `softness`, a step if that is 0."""

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        inside = radius - jnp.linalg.norm(gaussians.means, axis=-1)
        share = nn.sigmoid(inside / softness) if softness else (inside > 0).astype(inside.dtype)
        density = prepared["density"] * share + 1e-20
        height = jnp.clip(0.5 + 0.5 * gaussians.means[:, 2] / radius, 0.0, 1.0)[:, None]
        top, bottom = (jnp.asarray(color, inside.dtype)[None, :] for color in COLORS)
        return density + jnp.log(-jnp.expm1(-density)), height * top + (1.0 - height) * bottom

    return Field(
        init=lambda key: {"density": jnp.ones(())},
        prepare=lambda params: params,
        apply=apply,
        penalty=lambda key, prepared: jnp.zeros(()),
        density_scale=1.0,
    )


def chords(origins: np.ndarray, directions: np.ndarray, *, radius: float) -> np.ndarray:
    """[R] length of each ray within the ball about 0, float64; transmittance of a sharp ball is exp(-density x chord)."""
    along = -np.sum(origins * directions, axis=-1)
    aside = np.sum(origins**2, axis=-1) - along**2
    return 2.0 * np.sqrt(np.maximum(radius**2 - aside, 0.0))

"""A picture with opacity, as a thin sheet that faces one camera: the paper's two-dimensional baseline (appendix D).

Symbols: s height above the sheet, toward the camera; w the thickness, standard deviation of the sheet's profile; r the camera's
distance; a the opacity of a pixel. Density is softplus(logit a) times the profile, whose integral along every ray of that camera is
1: what the ray sees is the pixel, 1 - exp(-softplus(logit a)) = a, however thick the sheet.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp

from dreamfields_core.config import ImagePlaneConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.grids import read_grid, total_variation
from dreamfields_core.fields.rectified import log_of_raw, raw_of_log
from dreamfields_core.types import Array, Gaussians, Params

NEAREST = 1e-3
"""Share of the camera's distance below which a point counts as beside the camera: it has no pixel of its own."""

EDGE = 0.01
"""Share of the picture's half-side over which it ends."""


def image_plane(config: ImagePlaneConfig) -> Field:
    """The baseline that is no object: right from one side only."""
    right, up, toward = facing(config)

    def init(key: Array) -> Params:
        # Vertices from left to right, then from below.
        picture = config.spread * jax.random.normal(key, (config.resolution, config.resolution, 4))
        return {"picture": picture.at[..., 0].add(config.empty)}

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        points = gaussians.means
        height = jnp.sum(points * toward[None, :], axis=-1)
        # A ray of the camera stays in one pixel at every height: the picture is seen in perspective.
        ahead = jnp.maximum(1.0 - height / config.radius, NEAREST)
        across = jnp.stack([jnp.sum(points * axis[None, :], axis=-1) / ahead for axis in (right, up)], axis=-1)
        out = read_grid(prepared["picture"], across, bound=config.extent)
        log_density = log_of_raw(out[:, 0]) + log_profile(height, across, config)
        return raw_of_log(log_density), jax.nn.sigmoid(out[:, 1:])

    def penalty(key: Array, prepared: Params) -> Array:
        return config.smoothness * total_variation(prepared["picture"])

    return Field(init=init, prepare=lambda params: params, apply=apply, penalty=penalty, density_scale=1.0)


def facing(config: ImagePlaneConfig) -> tuple[Array, Array, Array]:
    """Unit vectors right and up in the picture and toward its camera, [3] each."""
    azimuth, elevation = math.radians(config.azimuth), math.radians(config.elevation)
    toward = (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation))
    up = (-math.sin(elevation) * math.cos(azimuth), -math.sin(elevation) * math.sin(azimuth), math.cos(elevation))
    return jnp.asarray([-math.sin(azimuth), math.cos(azimuth), 0.0]), jnp.asarray(up), jnp.asarray(toward)


def log_profile(height: Array, across: Array, config: ImagePlaneConfig) -> Array:
    """log of the density that an optical depth of 1 makes, [N]: normal in the height, per unit of the ray, which leans.

    height: [N] above the sheet. across: [N, 2] where the point's ray passes through it; beyond the picture's edge there is nothing.
    """
    normal = -0.5 * (height / config.thickness) ** 2 - math.log(config.thickness * math.sqrt(2.0 * math.pi))
    # The ray climbs r while it goes across: dt = ds sqrt(r^2 + |across|^2) / r.
    lean = 0.5 * jnp.log1p(jnp.sum((across / config.radius) ** 2, axis=-1))
    beyond = jnp.maximum(jnp.max(jnp.abs(across), axis=-1) / config.extent - 1.0, 0.0)
    return normal - lean - 0.5 * (beyond / EDGE) ** 2

"""Where the camera stands and what ray each pixel sends out (paper section 4.4).

Symbols: azimuth phi about Z, elevation theta above the horizon, radius r from the scene's origin; the camera looks at the
origin, its picture upright. Focal lengths are in image widths, so that they do not depend on resolution.
"""

from __future__ import annotations

from collections.abc import Sequence

import flax.struct
import jax
import jax.numpy as jnp

from dreamfields_core.config import CameraConfig, Range
from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Rays

FOCAL_UNIT = 1111.1111 / 800
"""Image widths; the focal length of NeRF's synthetic scenes, which the paper multiplies by m_focal."""


@flax.struct.dataclass
class Pose:
    """Cameras looking at the scene's origin.

    azimuth, elevation: [...] radians. radius: [...] world units. focal: [...] image widths.
    """

    azimuth: Array
    elevation: Array
    radius: Array
    focal: Array


def poses_at(azimuths: Sequence[float], elevation: float, *, radius: float, focal: float) -> Pose:
    """Cameras on a circle; angles in degrees. Returns a Pose of shape [len(azimuths)]."""
    azimuth = jnp.deg2rad(jnp.asarray(azimuths, jnp.float32))
    same = jnp.ones_like(azimuth)
    return Pose(azimuth, same * jnp.deg2rad(jnp.float32(elevation)), same * jnp.float32(radius), same * jnp.float32(focal))


def sample_poses(key: Array, camera: CameraConfig) -> Pose:
    """Draw the poses of one step (paper section 4.4). Returns a Pose of shape [camera.views].

    The azimuth range is cut into as many even parts as there are views; all are turned by one random angle and each is drawn
    within its part, so that every view alone is uniform and together they see the object from all sides.
    """
    turn_key, part_key, elevation_key, radius_key, focal_key = jax.random.split(key, 5)
    parts = (jnp.arange(camera.views) + jax.random.uniform(part_key, (camera.views,))) / camera.views
    share = (parts + jax.random.uniform(turn_key, ())) % 1.0
    azimuth = camera.azimuth.low + (camera.azimuth.high - camera.azimuth.low) * share
    return Pose(
        azimuth=jnp.deg2rad(azimuth),
        elevation=jnp.deg2rad(_draw(elevation_key, camera.elevation, camera.views)),
        radius=_draw(radius_key, camera.radius, camera.views),
        focal=_draw(focal_key, camera.focal, camera.views),
    )


def camera_rays(pose: Pose, origin: Array, *, size: int) -> Rays:
    """The rays through the centres of a square picture's pixels.

    Args:
      pose: [...].
      origin: [3] of the scene, which the camera looks at and moves with.
      size: pixels a side.

    Returns:
      Rays of shape [..., size, size], row 0 at the top.
    """
    pose, origin = in_float32((pose, origin))
    right, up, forward = camera_axes(pose)
    centers = (jnp.arange(size, dtype=jnp.float32) + 0.5) / size - 0.5
    down, across = jnp.meshgrid(centers, centers, indexing="ij")
    plane = jnp.stack([across, -down], axis=-1)
    aside = jnp.einsum("hwa,...ax->...hwx", plane, jnp.stack([right, up], axis=-2), precision=jax.lax.Precision.HIGHEST)
    toward = forward[..., None, None, :] + aside / pose.focal[..., None, None, None]
    length = jnp.linalg.norm(toward, axis=-1, keepdims=True)
    position = jnp.broadcast_to(origin, forward.shape) - pose.radius[..., None] * forward
    # mip-NeRF, section 3.1: a pixel of width w has the variance of a disc of radius 2 w / sqrt(12).
    pixel = 1.0 / (size * pose.focal[..., None, None, None])
    return Rays(
        origins=jnp.broadcast_to(position[..., None, None, :], toward.shape),
        directions=toward / length,
        radii=pixel * (2.0 / jnp.sqrt(12.0)) / length,
    )


def camera_axes(pose: Pose) -> tuple[Array, Array, Array]:
    """Unit vectors right, up and forward, [..., 3] each; written out, so that looking straight down has them too."""
    cos_azimuth, sin_azimuth = jnp.cos(pose.azimuth), jnp.sin(pose.azimuth)
    cos_elevation, sin_elevation = jnp.cos(pose.elevation), jnp.sin(pose.elevation)
    right = jnp.stack([-sin_azimuth, cos_azimuth, jnp.zeros_like(cos_azimuth)], axis=-1)
    up = jnp.stack([-sin_elevation * cos_azimuth, -sin_elevation * sin_azimuth, cos_elevation], axis=-1)
    forward = -jnp.stack([cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation], axis=-1)
    return right, up, forward


def _draw(key: Array, interval: Range, count: int) -> Array:
    return jax.random.uniform(key, (count,), minval=interval.low, maxval=interval.high)

"""Pictures by float64 quadrature, slow and plain: every sample of every ray, in NumPy but for the field itself.

The footprint of a sample's Gaussian is given and does not follow the step, so that a picture of 4 096 samples shows the very
field that one of 512 samples shows, and only the quadrature differs.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.fields.contract import Field
from dreamfields_core.types import Gaussians, Params, Rays


def quadrature(
    field: Field, params: Params, rays: Rays, origin: np.ndarray, *, bound: float, samples: int, footprint: float, block: int = 1 << 16
) -> tuple[np.ndarray, np.ndarray]:
    """Colour [R, 3], premultiplied, and transmittance [R], float64, by the midpoint rule with `samples` steps along the diagonal.

    footprint: length of ray that a sample's Gaussian covers, world units. block: samples asked of the field at once.
    """
    origins, directions, radii, center = (np.asarray(part, np.float64) for part in (*_parts(rays), origin))
    near, far = _cube(origins - center, directions, bound)
    step = 2.0 * math.sqrt(3.0) * bound / samples
    color, depth = np.zeros((len(near), 3)), np.zeros(len(near))
    with jax.enable_x64(True):
        prepared = jax.jit(field.prepare)(jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf, np.float64)), params))
        ask = jax.jit(field.apply)
        hit = np.flatnonzero(far > near)
        each = max(1, block // samples)
        for begin in range(0, len(hit), each):
            part = np.resize(hit[begin : begin + each], each)  # one shape: the last block repeats its rays
            start = np.arange(samples) * step
            length = np.clip((far - near)[part][:, None] - start, 0.0, step)
            middle = near[part][:, None] + start + 0.5 * length
            raw, colors = ask(prepared, _gaussians(origins[part], directions[part], radii[part], middle, footprint))
            density = field.density_scale * np.logaddexp(0.0, np.asarray(raw, np.float64).reshape(length.shape))
            tau = np.where(length > 0, density * length, 0.0)
            before = np.exp(-(np.cumsum(tau, axis=1) - tau))
            weight = before * -np.expm1(-tau)
            color[part] = np.einsum("rs,rsc->rc", weight, np.asarray(colors, np.float64).reshape(*length.shape, 3))
            depth[part] = tau.sum(axis=1)
    return color, np.exp(-depth)


def _parts(rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.asarray(rays.origins), np.asarray(rays.directions), np.asarray(rays.radii)[..., 0]


def _cube(start: np.ndarray, directions: np.ndarray, bound: float) -> tuple[np.ndarray, np.ndarray]:
    """Where rays enter and leave, [R] each; both 0 where they miss."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-bound - start) / directions, (bound - start) / directions
    near = np.maximum(np.nanmax(np.minimum(one, other), axis=-1), 0.0)
    far = np.nanmin(np.maximum(one, other), axis=-1)
    hit = far > near
    return np.where(hit, near, 0.0), np.where(hit, far, 0.0)


def _gaussians(origins: np.ndarray, directions: np.ndarray, radii: np.ndarray, middle: np.ndarray, footprint: float) -> Gaussians:
    """mip-NeRF, equation 7, as published: a frustum of `footprint` about each middle [R, S], flat."""
    half = 0.5 * footprint
    common = 3.0 * middle**2 + half**2
    mean = middle + 2.0 * middle * half**2 / common
    along = half**2 / 3.0 - (4.0 / 15.0) * half**4 * (12.0 * middle**2 - half**2) / common**2
    across = radii[:, None] ** 2 * (middle**2 / 4.0 + 5.0 * half**2 / 12.0 - 4.0 * half**4 / (15.0 * common))
    toward = np.broadcast_to(directions[:, None], (*middle.shape, 3))
    return Gaussians(
        means=jnp.asarray((origins[:, None] + mean[..., None] * toward).reshape(-1, 3)),
        directions=jnp.asarray(toward.reshape(-1, 3)),
        along=jnp.asarray(along.ravel()),
        across=jnp.asarray(across.ravel()),
    )

"""Feature grids from coarse to fine, added up, and a small network that reads the sum (paper appendix D, last sentence).

The coarse grids move large regions at once and the fine ones add detail: the sum is a multi-resolution basis, which Adam
conditions level by level. The grids are added into one before a step's samples are read, so a sample costs one lookup.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx

from dreamfields_core.config import HybridConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.grids import read_grid, resample, total_variation
from dreamfields_core.types import Array, Gaussians, Params


def hybrid(config: HybridConfig, *, bound: float) -> Field:
    """The fast field of the draft preset."""
    finest = max(config.resolutions)
    channels = config.features if config.depth else 4

    def init(key: Array) -> Params:
        grid_key, layer_key = jax.random.split(key)
        grids = {
            f"grid{resolution}": config.spread * jax.random.normal(part, (resolution + 1,) * 3 + (channels,))
            for resolution, part in zip(config.resolutions, jax.random.split(grid_key, len(config.resolutions)), strict=True)
        }
        sizes = [channels] + [config.width] * config.depth + [4]
        layers = {
            f"layer{index}": _dense(part, into=into, out=out)
            for index, (part, into, out) in enumerate(
                zip(jax.random.split(layer_key, config.depth + 1), sizes[:-1], sizes[1:], strict=True)
            )
        }
        return {"grids": grids, "layers": layers if config.depth else {}}

    def prepare(params: Params) -> Params:
        weights = [config.falloff**level for level in range(len(config.resolutions))]
        grid = sum(
            weight * resample(params["grids"][f"grid{resolution}"], resolution=finest)
            for weight, resolution in zip(weights, config.resolutions, strict=True)
        )
        return {"grid": grid, "layers": params["layers"]}

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        out = read_grid(prepared["grid"], gaussians.means, bound=bound)
        for index in range(len(prepared["layers"])):
            layer = prepared["layers"][f"layer{index}"]
            fed = nnx.swish(out) if index else out
            out = jnp.matmul(fed, layer["kernel"], precision=jax.lax.Precision.HIGHEST) + layer["bias"][None, :]
        return out[:, 0] + initial_shape(gaussians.means, config), nnx.sigmoid(out[:, 1:])

    def penalty(key: Array, prepared: Params) -> Array:
        return config.smoothness * total_variation(prepared["grid"])

    return Field(init=init, prepare=prepare, apply=apply, penalty=penalty, density_scale=config.density_scale)


def initial_shape(points: Array, config: HybridConfig) -> Array:
    """Raw density that the field starts from, [N]: a soft ball in emptiness."""
    bump = jnp.exp(-0.5 * jnp.sum(points**2, axis=-1) / config.blob_radius**2)
    return config.empty + (config.blob - config.empty) * bump


def _dense(key: Array, *, into: int, out: int) -> Params:
    return {"kernel": nnx.initializers.lecun_normal()(key, (into, out)), "bias": jnp.zeros((out,))}

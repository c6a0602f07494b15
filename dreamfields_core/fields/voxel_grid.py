"""Density and colours at the vertices of one grid, without a network: the paper's voxel baseline (appendix D)."""

from __future__ import annotations

import jax

from dreamfields_core.config import VoxelGridConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.grids import read_grid, total_variation
from dreamfields_core.types import Array, Gaussians, Params


def voxel_grid(config: VoxelGridConfig, *, bound: float) -> Field:
    """The baseline whose every number is a voxel's own."""

    def init(key: Array) -> Params:
        side = config.resolution
        grid = config.spread * jax.random.normal(key, (side, side, side, 4))
        return {"grid": grid.at[..., 0].add(config.empty)}

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        out = read_grid(prepared["grid"], gaussians.means, bound=bound)
        return out[:, 0], jax.nn.sigmoid(out[:, 1:])

    def penalty(key: Array, prepared: Params) -> Array:
        # Of the raw density: that of the opacity would not see the difference between empty and emptier, nor be felt inside.
        return config.smoothness * total_variation(prepared["grid"][..., :1])

    return Field(init=init, prepare=lambda params: params, apply=apply, penalty=penalty, density_scale=config.density_scale)

"""From a configuration to its field."""

from __future__ import annotations

from typing import assert_never

import jax.numpy as jnp
from jax.typing import DTypeLike

from dreamfields_core.config import (
    FieldConfig,
    HybridConfig,
    ImagePlaneConfig,
    NeRFMLPConfig,
    ResidualMLPConfig,
    SignedDistanceConfig,
    VoxelGridConfig,
)
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.hybrid import hybrid
from dreamfields_core.fields.image_plane import image_plane
from dreamfields_core.fields.nerf_mlp import nerf_mlp
from dreamfields_core.fields.residual_mlp import residual_mlp
from dreamfields_core.fields.signed_distance import signed_distance
from dreamfields_core.fields.voxel_grid import voxel_grid


def build_field(config: FieldConfig, *, bound: float, products: DTypeLike = jnp.float32) -> Field:
    """The field that `config` names, for a scene of half-side `bound`; `products`: type of the factors of large matrix products."""
    match config:
        case ResidualMLPConfig():
            return residual_mlp(config, products=products)
        case NeRFMLPConfig():
            return nerf_mlp(config, products=products)
        case HybridConfig():
            return hybrid(config, bound=bound)
        case VoxelGridConfig():
            return voxel_grid(config, bound=bound)
        case SignedDistanceConfig():
            return signed_distance(config, bound=bound, products=products)
        case ImagePlaneConfig():
            return image_plane(config)
    assert_never(config)

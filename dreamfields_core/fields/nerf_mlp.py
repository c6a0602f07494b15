"""The plain network of NeRF (Mildenhall et al. 2020, appendix A) without the viewing direction: the baseline of the paper's table 1.

Density is rectified by a softplus, as every field's is here; NeRF's own took a ReLU, whose slope is zero wherever nothing is yet.
"""

from __future__ import annotations

import jax.numpy as jnp
from flax import nnx
from jax.typing import DTypeLike

from dreamfields_core.config import NeRFMLPConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.encodings import encode, encoding_size, initial_frequencies
from dreamfields_core.fields.network import dense, network_field
from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Gaussians


class NeRFMLP(nnx.Module):
    """Encoding -> `depth` times Dense, ReLU -> Dense 4; the encoding is handed in once more after the middle layer."""

    def __init__(self, config: NeRFMLPConfig, rngs: nnx.Rngs, *, products: DTypeLike = jnp.float32) -> None:
        self.frequencies = nnx.Param(initial_frequencies(rngs.params(), config))
        self.integrated, size = config.integrated, encoding_size(config)
        self.skip = config.depth // 2
        layers, into = [], size
        for index in range(config.depth):
            # The encoding is not rounded to bfloat16, nor is what decides the density.
            layers.append(dense(into, config.width, rngs, products=jnp.float32 if index in (0, self.skip + 1) else products))
            into = config.width + (size if index == self.skip else 0)
        self.layers = nnx.List(layers)
        self.out = dense(into, 4, rngs)

    def __call__(self, gaussians: Gaussians) -> tuple[Array, Array]:
        encoded = encode(self.frequencies[...], gaussians, integrated=self.integrated)
        hidden = encoded
        for index, layer in enumerate(self.layers):
            hidden = nnx.relu(in_float32(layer(hidden)))
            if index == self.skip:
                hidden = jnp.concatenate([encoded, hidden], axis=-1)
        out = self.out(hidden)
        return out[:, 0], nnx.sigmoid(out[:, 1:])


def nerf_mlp(config: NeRFMLPConfig, *, products: DTypeLike = jnp.float32) -> Field:
    """The baseline's field; 494 k parameters at NeRF's own ten levels, as the paper counts them."""
    return network_field(lambda rngs: NeRFMLP(config, rngs, products=products))

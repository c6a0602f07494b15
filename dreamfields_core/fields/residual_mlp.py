"""The paper's network (section 4.7): residual blocks with layer normalisation and a widened middle, swish throughout."""

from __future__ import annotations

import jax.numpy as jnp
from flax import nnx
from jax.typing import DTypeLike

from dreamfields_core.config import ResidualMLPConfig, SignedDistanceConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.encodings import encode, encoding_size, initial_frequencies
from dreamfields_core.fields.network import dense, network_field
from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Gaussians


class Block(nnx.Module):
    """x + Dense(swish(Dense(LayerNorm(x)))), widened in the middle."""

    def __init__(self, config: ResidualMLPConfig | SignedDistanceConfig, rngs: nnx.Rngs, *, products: DTypeLike) -> None:
        self.norm = nnx.LayerNorm(config.width, rngs=rngs)
        self.widen = dense(config.width, config.bottleneck, rngs, products=products)
        self.narrow = dense(config.bottleneck, config.width, rngs, products=products)

    def __call__(self, hidden: Array) -> Array:
        return hidden + in_float32(self.narrow(nnx.swish(self.widen(self.norm(hidden)))))


class ResidualMLP(nnx.Module):
    """Encoding -> Dense, swish -> blocks -> Dense, swish -> Dense 4: raw density and colour logits.

    The factors of the products between (nine tenths of the work) are of type `products`. All else is float32: sums and norms, the
    first product, whose encoding bfloat16 would round to one part in 256, and the last, which decides the density.
    """

    def __init__(self, config: ResidualMLPConfig | SignedDistanceConfig, rngs: nnx.Rngs, *, products: DTypeLike = jnp.float32) -> None:
        self.frequencies = nnx.Param(initial_frequencies(rngs.params(), config))
        self.integrated = config.integrated
        self.enter = dense(encoding_size(config), config.width, rngs)
        self.blocks = nnx.List([Block(config, rngs, products=products) for _ in range(config.blocks)])
        self.leave = dense(config.width, config.width, rngs, products=products)
        self.out = dense(config.width, 4, rngs)

    def __call__(self, gaussians: Gaussians) -> tuple[Array, Array]:
        hidden = nnx.swish(self.enter(encode(self.frequencies[...], gaussians, integrated=self.integrated)))
        for block in self.blocks:
            hidden = block(hidden)
        out = self.out(nnx.swish(in_float32(self.leave(hidden))))
        return out[:, 0], nnx.sigmoid(out[:, 1:])


def residual_mlp(config: ResidualMLPConfig, *, products: DTypeLike = jnp.float32) -> Field:
    """The paper's field; 315 k parameters at the paper's sizes."""
    return network_field(lambda rngs: ResidualMLP(config, rngs, products=products))

"""The paper's network (section 4.6): residual blocks with layer normalisation and a widened middle, swish throughout."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx

from dreamfields_core.config import ResidualMLPConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.encodings import integrated_encoding, sample_frequencies
from dreamfields_core.types import Array, Gaussians, Params


class Block(nnx.Module):
    """x + Dense(swish(Dense(LayerNorm(x)))), widened in the middle."""

    def __init__(self, config: ResidualMLPConfig, rngs: nnx.Rngs) -> None:
        self.norm = nnx.LayerNorm(config.width, rngs=rngs)
        self.widen = nnx.Linear(config.width, config.bottleneck, rngs=rngs)
        self.narrow = nnx.Linear(config.bottleneck, config.width, rngs=rngs)

    def __call__(self, hidden: Array) -> Array:
        return hidden + self.narrow(nnx.swish(self.widen(self.norm(hidden))))


class ResidualMLP(nnx.Module):
    """Encoding -> Dense, swish -> blocks -> Dense, swish -> Dense 4: raw density and colour logits."""

    def __init__(self, config: ResidualMLPConfig, rngs: nnx.Rngs) -> None:
        self.frequencies = nnx.Param(sample_frequencies(rngs.params(), config.frequencies, levels=config.levels))
        self.enter = nnx.Linear(3 + 2 * config.frequencies, config.width, rngs=rngs)
        self.blocks = nnx.List([Block(config, rngs) for _ in range(config.blocks)])
        self.leave = nnx.Linear(config.width, config.width, rngs=rngs)
        self.out = nnx.Linear(config.width, 4, rngs=rngs)

    def __call__(self, gaussians: Gaussians) -> tuple[Array, Array]:
        # The frequencies travel with the parameters but stay as drawn: no gradient, so Adam never moves them.
        frequencies = jax.lax.stop_gradient(self.frequencies[...])
        hidden = nnx.swish(self.enter(integrated_encoding(frequencies, gaussians)))
        for block in self.blocks:
            hidden = block(hidden)
        out = self.out(nnx.swish(self.leave(hidden)))
        return out[:, 0], nnx.sigmoid(out[:, 1:])


def residual_mlp(config: ResidualMLPConfig) -> Field:
    """The paper's field; 315 k parameters at the paper's sizes."""
    graph = nnx.graphdef(nnx.eval_shape(lambda: ResidualMLP(config, nnx.Rngs(0))))

    def init(key: Array) -> Params:
        return nnx.to_pure_dict(nnx.state(ResidualMLP(config, nnx.Rngs(params=key))))

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        return nnx.merge(graph, nnx.State(prepared))(gaussians)

    return Field(
        init=init,
        prepare=lambda params: params,
        apply=apply,
        penalty=lambda prepared: jnp.zeros(()),
        density_scale=1.0,
    )

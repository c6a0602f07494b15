"""The image tower: a vision transformer (Dosovitskiy 2020), with CLIP's and SigLIP's variations.

Pictures come prepared: [batch, size, size, 3], resized and normalised (preprocess.py).
"""

from __future__ import annotations

import jax.numpy as jnp
from flax import nnx

from dreamfields_core.guidance.architecture import ImageTower, Stack
from dreamfields_core.guidance.transformer import MLP, attend, blocks, linear, norm, through
from dreamfields_core.types import Array


def patches(images: Array, side: int) -> Array:
    """[batch, H, W, 3] -> [batch, (H / side) (W / side), side x side x 3], row by row; within a patch rows, columns, channels."""
    batch, height, width, channels = images.shape
    tiles = images.reshape(batch, height // side, side, width // side, side, channels)
    return tiles.transpose(0, 1, 3, 2, 4, 5).reshape(batch, -1, side * side * channels)


class QueryPool(nnx.Module):
    """One learned query attends to all tokens, then a residual MLP (SigLIP's pooling head, after Lee 2019)."""

    def __init__(self, stack: Stack, rngs: nnx.Rngs) -> None:
        self.heads = stack.heads
        self.probe = nnx.Param(jnp.zeros(stack.width))
        self.ask = linear(stack.width, stack.width, rngs)
        self.tell = linear(stack.width, 2 * stack.width, rngs)
        self.out = linear(stack.width, stack.width, rngs)
        self.norm = norm(stack.width, stack.epsilon, rngs)
        self.mlp = MLP(stack, rngs)

    def __call__(self, tokens: Array) -> Array:
        batch, count, width = tokens.shape
        query = self.ask(self.probe[...]).reshape(1, 1, self.heads, -1)
        told = self.tell(tokens).reshape(batch, count, 2, self.heads, -1)
        query = jnp.broadcast_to(query, (batch, *query.shape[1:]))
        pooled = self.out(attend(query, told[:, :, 0], told[:, :, 1], None).reshape(batch, width))
        return pooled + self.mlp(self.norm(pooled))


class VisionTransformer(nnx.Module):
    """Patches -> tokens -> blocks -> one token -> embedding [batch, dim], not yet of unit length."""

    def __init__(self, tower: ImageTower, rngs: nnx.Rngs) -> None:
        stack = tower.stack
        self.side, self.pool = tower.patch, tower.pool
        self.patch = linear(3 * tower.patch**2, stack.width, rngs, bias=tower.patch_bias)
        self.class_token = nnx.Param(jnp.zeros(stack.width)) if tower.class_token else None
        self.positions = nnx.Param(jnp.zeros((tower.tokens, stack.width)))
        self.enter = norm(stack.width, stack.epsilon, rngs) if tower.enter_norm else None
        self.blocks = blocks(stack, rngs)
        self.leave = norm(stack.width, stack.epsilon, rngs)
        self.query = QueryPool(stack, rngs) if tower.pool == "query" else None
        self.project = linear(stack.width, tower.dim, rngs, bias=tower.project_bias) if tower.dim else None

    def __call__(self, images: Array) -> Array:
        tokens = self.patch(patches(images, self.side))
        if self.class_token is not None:
            first = jnp.broadcast_to(self.class_token[...], (tokens.shape[0], 1, tokens.shape[2])).astype(jnp.float32)
            tokens = jnp.concatenate([first, tokens], axis=1)
        tokens = tokens + self.positions[...].astype(jnp.float32)[None]
        if self.enter is not None:
            tokens = self.enter(tokens)
        tokens = through(self.blocks, tokens)
        # A normalisation looks at one token at a time: where only one is kept, only one is normalised.
        pooled = self.leave(tokens[:, 0]) if self.query is None else self.query(self.leave(tokens))
        return pooled if self.project is None else self.project(pooled)

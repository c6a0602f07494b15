"""The text tower: CLIP's causal transformer, SigLIP's and LiT's transformers that see all tokens, and BERT."""

from __future__ import annotations

import jax.numpy as jnp
from flax import nnx

from dreamfields_core.guidance.architecture import TextTower
from dreamfields_core.guidance.transformer import FAR, blocks, linear, norm, through
from dreamfields_core.types import Array


def sight(tokens: Array, tower: TextTower) -> Array | None:
    """What each token may see, as a bias [batch or 1, 1, length, length] of 0 and FAR on the attention's logits; None where all."""
    if tower.causal:
        length = tokens.shape[1]
        return jnp.where(jnp.tri(length, dtype=bool), 0.0, FAR)[None, None]
    if tower.skip_padding:
        return jnp.where(tokens != 0, 0.0, FAR)[:, None, None]
    return None


class TextTransformer(nnx.Module):
    """Tokens [batch, length] -> blocks -> one token -> embedding [batch, dim], not yet of unit length."""

    def __init__(self, tower: TextTower, rngs: nnx.Rngs) -> None:
        stack = tower.stack
        self.tower = tower
        self.words = nnx.Param(jnp.zeros((tower.vocabulary, stack.width)))
        self.positions = nnx.Param(jnp.zeros((tower.positions, stack.width)))
        self.enter = norm(stack.width, stack.epsilon, rngs) if tower.enter_norm else None
        self.blocks = blocks(stack, rngs)
        self.leave = norm(stack.width, stack.epsilon, rngs) if tower.leave_norm else None
        self.project = linear(stack.width, tower.dim, rngs, bias=tower.project_bias) if tower.dim else None

    def __call__(self, tokens: Array) -> Array:
        words = jnp.take(self.words[...], tokens, axis=0).astype(jnp.float32)
        hidden = words + self.positions[...].astype(jnp.float32)[None, : tokens.shape[1]]
        if self.enter is not None:
            hidden = self.enter(hidden)
        hidden = through(self.blocks, hidden, sight(tokens, self.tower))
        pooled = hidden[jnp.arange(tokens.shape[0]), self._place(tokens)]
        if self.leave is not None:
            pooled = self.leave(pooled)
        return pooled if self.project is None else self.project(pooled)

    def _place(self, tokens: Array) -> Array:
        """Which token stands for the caption: [batch]."""
        if self.tower.pool == "highest":
            return jnp.argmax(tokens, axis=1)
        return jnp.full(tokens.shape[0], 0 if self.tower.pool == "first" else tokens.shape[1] - 1)

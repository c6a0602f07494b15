"""One transformer block, which all towers of all families share, and a stack of them.

Tokens are [batch, tokens, width]. Weights may be stored in half precision: every layer computes in float32. A stack holds each weight
of its blocks in one array, [layers, ...], and is one loop over them: one block is compiled however many there are, and what the
gradient needs is kept or made again as the loop says. (Without a loop, a compiler for processors recognises what is made again as
what was made before, and keeps it after all.)
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jax.ad_checkpoint import checkpoint_name

from dreamfields_core.guidance.architecture import Activation, Stack
from dreamfields_core.types import Array

KEPT = "kept for the gradient"
"""What large products give; the attention's weights, normalisations and activations are cheap, and made again."""

FAR = -1e9
"""Added to the logit of what must not be seen; exp of it is exactly 0, and unlike -inf it has a difference with itself."""


def activate(hidden: Array, name: Activation) -> Array:
    """Gaussian error unit (Hendrycks and Gimpel 2016), exactly, by the tanh formula, or as x sigmoid(1.702 x)."""
    if name == "quick_gelu":
        return hidden * jax.nn.sigmoid(1.702 * hidden)
    return jax.nn.gelu(hidden, approximate=name == "gelu_tanh")


def linear(n: int, m: int, rngs: nnx.Rngs, *, bias: bool = True) -> nnx.Linear:
    """x W + b in float32, whatever the weights are stored in."""
    return nnx.Linear(n, m, use_bias=bias, dtype=jnp.float32, rngs=rngs)


def norm(width: int, epsilon: float, rngs: nnx.Rngs) -> nnx.LayerNorm:
    """Layer normalisation (Ba 2016); the variance as the mean of squared differences, which does not cancel."""
    return nnx.LayerNorm(width, epsilon=epsilon, dtype=jnp.float32, use_fast_variance=False, rngs=rngs)


def attend(queries: Array, keys: Array, values: Array, bias: Array | None) -> Array:
    """softmax(q k' / sqrt(d) + bias) v (Vaswani 2017, equation 1).

    Args:
      queries: [batch, q, heads, d]. keys, values: [batch, k, heads, d].
      bias: broadcastable to [batch, heads, q, k], 0 or FAR.

    Returns:
      [batch, q, heads x d].
    """
    logits = jnp.einsum("bqhd,bkhd->bhqk", queries * queries.shape[-1] ** -0.5, keys)
    weights = jax.nn.softmax(logits if bias is None else logits + bias)
    mixed = jnp.einsum("bhqk,bkhd->bqhd", weights, values)
    return mixed.reshape(*mixed.shape[:2], -1)


class Attention(nnx.Module):
    """Multi-head attention of tokens among themselves; queries, keys and values from one product."""

    def __init__(self, stack: Stack, rngs: nnx.Rngs) -> None:
        self.heads = stack.heads
        self.mix = linear(stack.width, 3 * stack.width, rngs)
        self.out = linear(stack.width, stack.width, rngs)

    def __call__(self, tokens: Array, bias: Array | None) -> Array:
        mixed = checkpoint_name(self.mix(tokens), KEPT).reshape(*tokens.shape[:2], 3, self.heads, -1)
        return self.out(attend(mixed[:, :, 0], mixed[:, :, 1], mixed[:, :, 2], bias))


class MLP(nnx.Module):
    """Dense(activation(Dense(x))), widened in the middle."""

    def __init__(self, stack: Stack, rngs: nnx.Rngs) -> None:
        self.activation = stack.activation
        self.widen = linear(stack.width, stack.hidden, rngs)
        self.narrow = linear(stack.hidden, stack.width, rngs)

    def __call__(self, tokens: Array) -> Array:
        return self.narrow(activate(checkpoint_name(self.widen(tokens), KEPT), self.activation))


class Block(nnx.Module):
    """x + f(norm(x)) for attention, then for the MLP; or norm(x + f(x)) as in BERT."""

    def __init__(self, stack: Stack, rngs: nnx.Rngs) -> None:
        self.norm_first = stack.norm_first
        self.norm1 = norm(stack.width, stack.epsilon, rngs)
        self.attention = Attention(stack, rngs)
        self.norm2 = norm(stack.width, stack.epsilon, rngs)
        self.mlp = MLP(stack, rngs)

    def __call__(self, tokens: Array, bias: Array | None = None) -> Array:
        if self.norm_first:
            tokens = checkpoint_name(tokens + self.attention(self.norm1(tokens), bias), KEPT)
            return tokens + self.mlp(self.norm2(tokens))
        tokens = checkpoint_name(self.norm1(tokens + self.attention(tokens, bias)), KEPT)
        return self.norm2(tokens + self.mlp(tokens))


def blocks(stack: Stack, rngs: nnx.Rngs) -> Block:
    """All blocks of a stack as one whose weights are [layers, ...], first to last."""
    return nnx.vmap(lambda own: Block(stack, own))(rngs.split(stack.layers))


def through(stack: Block, tokens: Array, bias: Array | None = None) -> Array:
    """The tokens after all blocks of `blocks`, same shape."""
    graph, weights = nnx.split(stack)

    def one(tokens: Array, own: nnx.State) -> tuple[Array, None]:
        return nnx.merge(graph, own)(tokens, bias), None

    remembered = jax.checkpoint(one, prevent_cse=False, policy=jax.checkpoint_policies.save_only_these_names(KEPT))
    return jax.lax.scan(remembered, tokens, weights)[0]

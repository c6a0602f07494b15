"""The few layers that image-text models are made of, as functions of their weights (a dict of arrays each)."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array, Params


def along_last(vector: Array, x: Array) -> Array:
    """[width] -> [1, ..., width], to meet `x` [..., width]."""
    return vector.reshape((1,) * (x.ndim - 1) + vector.shape)


def init_linear(key: Array, inputs: int, outputs: int, *, scale: float = 1.0) -> Params:
    """Weight [inputs, outputs], bias [outputs]."""
    return {"w": jax.random.normal(key, (inputs, outputs)) * scale * inputs**-0.5, "b": jnp.zeros(outputs)}


def linear(params: Params, x: Array) -> Array:
    """[..., inputs] -> [..., outputs]."""
    y = x @ params["w"]
    return y + along_last(params["b"], y)


def init_conv(key: Array, inputs: int, outputs: int, *, scale: float = 1.0) -> Params:
    """A 3 x 3 convolution."""
    weight = jax.random.normal(key, (3, 3, inputs, outputs)) * scale * (2 / (9 * inputs)) ** 0.5
    return {"w": weight, "b": jnp.zeros(outputs)}


def conv(params: Params, x: Array, *, stride: int = 1) -> Array:
    """[batch, height, width, inputs] -> [batch, height / stride, width / stride, outputs]."""
    y = jax.lax.conv_general_dilated(x, params["w"], (stride, stride), "SAME", dimension_numbers=("NHWC", "HWIO", "NHWC"))
    return y + along_last(params["b"], y)


def init_residual(key: Array, width: int, *, gain: float = 0.2) -> Params:
    """Two convolutions and a learned weight of what they add."""
    first, second = jax.random.split(key)
    return {"first": init_conv(first, width, width), "second": init_conv(second, width, width), "gain": jnp.full(width, gain)}


def residual(params: Params, x: Array) -> Array:
    """x + gain * conv(silu(conv(silu(x)))): needs no normalisation, so that one picture does not depend on its batch."""
    y = conv(params["first"], jax.nn.silu(x))
    return x + along_last(params["gain"], x) * conv(params["second"], jax.nn.silu(y))


def space_to_depth(x: Array, side: int) -> Array:
    """[batch, height, width, c] -> [batch, height / side, width / side, side * side * c]."""
    batch, height, width, channels = x.shape
    x = x.reshape(batch, height // side, side, width // side, side, channels)
    return x.transpose(0, 1, 3, 2, 4, 5).reshape(batch, height // side, width // side, side * side * channels)


def init_norm(width: int) -> Params:
    """Scale and shift."""
    return {"scale": jnp.ones(width), "shift": jnp.zeros(width)}


def norm(params: Params, x: Array, *, epsilon: float = 1e-5) -> Array:
    """Layer normalisation over the last axis."""
    x = x - x.mean(-1, keepdims=True)
    x = x * jax.lax.rsqrt((x * x).mean(-1, keepdims=True) + epsilon)
    return x * along_last(params["scale"], x) + along_last(params["shift"], x)


def init_transformer(key: Array, width: int, *, widening: int = 4) -> Params:
    """One pre-norm block: attention, then a two-layer perceptron."""
    keys = jax.random.split(key, 4)
    return {
        "norm1": init_norm(width),
        "qkv": init_linear(keys[0], width, 3 * width),
        "out": init_linear(keys[1], width, width, scale=0.5),
        "norm2": init_norm(width),
        "up": init_linear(keys[2], width, widening * width),
        "down": init_linear(keys[3], widening * width, width, scale=0.5),
    }


def transformer(params: Params, x: Array, *, heads: int, mask: Array | None = None) -> Array:
    """[batch, length, width] -> the same; `mask` [batch, length] is False where a token is padding."""
    batch, length, width = x.shape
    q, k, v = jnp.split(linear(params["qkv"], norm(params["norm1"], x)).reshape(batch, length, heads, 3 * width // heads), 3, axis=-1)
    logits = jnp.einsum("bqhd,bkhd->bhqk", q, k) * (width // heads) ** -0.5
    if mask is not None:
        logits = jnp.where(mask[:, None, None, :], logits, -1e9)
    mixed = jnp.einsum("bhqk,bkhd->bqhd", jax.nn.softmax(logits), v).reshape(batch, length, width)
    x = x + linear(params["out"], mixed)
    return x + linear(params["down"], jax.nn.silu(linear(params["up"], norm(params["norm2"], x))))


def unit(x: Array) -> Array:
    """Scaled to length 1 along the last axis; a zero vector stays finite, and so does its gradient."""
    return x * jax.lax.rsqrt((x * x).sum(-1, keepdims=True) + 1e-12)

"""The towers of our own models: two ways of seeing (convolution, attention), one way of reading."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from dreamfields_core.guidance import blocks
from dreamfields_core.types import Array, Params


@dataclass(frozen=True)
class Architecture:
    """Sizes of a model; all of them travel in its file.

    seeing: 'convolution' (residual blocks, no normalisation) or 'attention' (a convolutional stem, then a transformer).
    image_size: side of a picture; a multiple of 8.
    dim: length of an embedding.
    fine, coarse: channels at a quarter and at an eighth of the picture's side.
    fine_blocks, coarse_blocks: residual or transformer blocks at each.
    words, length: size of the vocabulary with its two marks (padding, unknown), and tokens a caption.
    text_width, text_blocks, heads: the reading tower.
    heads: of the seeing transformer.
    """

    seeing: str = "convolution"
    image_size: int = 48
    dim: int = 128
    fine: int = 48
    coarse: int = 128
    fine_blocks: int = 2
    coarse_blocks: int = 3
    words: int = 2
    length: int = 18
    text_width: int = 96
    text_blocks: int = 2
    heads: int = 4


def init(key: Array, architecture: Architecture) -> Params:
    """Fresh weights: {'image', 'text', 'log_scale'}."""
    image, text = jax.random.split(key)
    return {"image": _init_image(image, architecture), "text": _init_text(text, architecture), "log_scale": jnp.float32(jnp.log(10.0))}


def _init_image(key: Array, a: Architecture) -> Params:
    keys = iter(jax.random.split(key, 8 + a.fine_blocks + a.coarse_blocks))
    attention = a.seeing == "attention"
    coarse = [
        blocks.init_transformer(next(keys), a.coarse) if attention else blocks.init_residual(next(keys), a.coarse)
        for _ in range(a.coarse_blocks)
    ]
    params = {
        "stem": blocks.init_conv(next(keys), 48, a.fine),
        "fine": [blocks.init_residual(next(keys), a.fine) for _ in range(a.fine_blocks)],
        "shrink": blocks.init_conv(next(keys), a.fine, a.coarse),
        "coarse": coarse,
        "hidden": blocks.init_linear(next(keys), 2 * a.coarse, 2 * a.coarse),
        "out": blocks.init_linear(next(keys), 2 * a.coarse, a.dim),
    }
    if attention:
        params["place"] = 0.02 * jax.random.normal(next(keys), ((a.image_size // 8) ** 2, a.coarse))
        params["norm"] = blocks.init_norm(a.coarse)
        params["query"] = blocks.init_linear(next(keys), a.coarse, a.heads)
    return params


def see(params: Params, images: Array, a: Architecture) -> Array:
    """Pictures [batch, size, size, 3] in [0, 1] -> unit vectors [batch, dim]."""
    params = params["image"]
    x = blocks.conv(params["stem"], blocks.space_to_depth(2 * images - 1, 4))
    for block in params["fine"]:
        x = blocks.residual(block, x)
    x = blocks.conv(params["shrink"], jax.nn.silu(x), stride=2)
    x = _attend(params, x, a) if a.seeing == "attention" else _convolve(params, x)
    hidden = jax.nn.silu(blocks.linear(params["hidden"], x))
    return blocks.unit(blocks.linear(params["out"], hidden))


def _in_a_row(x: Array) -> Array:
    """[batch, height, width, c] -> [batch, height * width, c]; a batch may be empty."""
    return x.reshape(x.shape[0], x.shape[1] * x.shape[2], x.shape[3])


def _convolve(params: Params, x: Array) -> Array:
    """Residual blocks, then the mean and a soft maximum over places: [batch, 2 * coarse]."""
    for block in params["coarse"]:
        x = blocks.residual(block, x)
    x = jax.nn.silu(_in_a_row(x))
    return jnp.concatenate([x.mean(1), jax.nn.logsumexp(x, 1) - jnp.log(x.shape[1] * 1.0)], -1)


def _attend(params: Params, x: Array, a: Architecture) -> Array:
    """Transformer blocks, then the mean and what learned queries look at, a share of the channels each: [batch, 2 * coarse]."""
    x = _in_a_row(x) + params["place"][None]
    for block in params["coarse"]:
        x = blocks.transformer(block, x, heads=a.heads)
    x = blocks.norm(params["norm"], x)
    attention = jax.nn.softmax(blocks.linear(params["query"], x), 1)
    values = x.reshape(*x.shape[:2], a.heads, a.coarse // a.heads)
    looked = jnp.einsum("blh,blhd->bhd", attention, values).reshape(x.shape[0], a.coarse)
    return jnp.concatenate([x.mean(1), looked], -1)


def _init_text(key: Array, a: Architecture) -> Params:
    keys = jax.random.split(key, 3 + a.text_blocks)
    return {
        "words": 0.5 * jax.random.normal(keys[0], (a.words, a.text_width)),
        "place": 0.1 * jax.random.normal(keys[1], (a.length, a.text_width)),
        "blocks": [blocks.init_transformer(k, a.text_width, widening=2) for k in keys[3:]],
        "norm": blocks.init_norm(a.text_width),
        "out": blocks.init_linear(keys[2], a.text_width, a.dim),
    }


def read(params: Params, tokens: Array, a: Architecture) -> Array:
    """Tokens [batch, length], 0 is padding -> unit vectors [batch, dim]."""
    params, mask = params["text"], tokens > 0
    x = params["words"][tokens] + params["place"][None, : tokens.shape[1]]
    for block in params["blocks"]:
        x = blocks.transformer(block, x, heads=2, mask=mask)
    x = jnp.where(mask[..., None], blocks.norm(params["norm"], x), 0).sum(1) / jnp.maximum(mask.sum(1, keepdims=True), 1)
    return blocks.unit(blocks.linear(params["out"], x))

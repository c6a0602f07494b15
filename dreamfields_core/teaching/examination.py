"""What a model has learned: retrieval of the right caption among many, clean and under attack."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.teaching.contrast import toward_ball
from dreamfields_core.teaching.language import Description, describe
from dreamfields_core.teaching.pools import hard_pool
from dreamfields_core.types import Array, Encoder


def on_white(pictures: np.ndarray) -> np.ndarray:
    """RGBA uint8 [n, size, size, 4], premultiplied -> float32 [n, size, size, 3] in [0, 1]."""
    x = pictures.astype(np.float32) / 255
    return x[..., :3] + 1 - x[..., 3:]


def embed_captions(encoder: Encoder, descriptions: Sequence[Description], *, batch: int = 256) -> np.ndarray:
    """Unit vectors [n, dim] of the plain captions."""
    tokens = encoder.tokenize([describe(d) for d in descriptions])
    return _in_batches(jax.jit(encoder.encode_text), encoder, tokens, batch)


def _in_batches(encode: Callable[..., Array], encoder: Encoder, values: np.ndarray, batch: int) -> np.ndarray:
    """One compiled shape for any number of values [n, ...]."""
    padded = np.concatenate([values, np.repeat(values[:1], -len(values) % batch, 0)])
    parts = [np.asarray(encode(encoder.params, padded[i : i + batch])) for i in range(0, len(padded), batch)]
    return np.concatenate(parts)[: len(values)]


def embed_images(encoder: Encoder, images: np.ndarray, *, batch: int = 64) -> np.ndarray:
    """Unit vectors [n, dim]."""
    return _in_batches(jax.jit(encoder.encode_image), encoder, images, batch)


def ranks(images: np.ndarray, texts: np.ndarray) -> np.ndarray:
    """For picture i, how many of the other captions [m, dim] score as high as caption i or higher, [n]; what is not a number is last."""
    scores = images @ texts.T
    own = np.diagonal(scores)[:, None]
    return (~(scores < own)).sum(1) - 1


def hard_ranks(encoder: Encoder, images: np.ndarray, descriptions: Sequence[Description], *, pool: int = 30) -> np.ndarray:
    """For each picture, how many captions of its hard pool score as high as its own or higher, [n]; what is not a number is last."""
    pools = [[description, *hard_pool(description, pool)] for description in descriptions]
    row = {d: i for i, d in enumerate(dict.fromkeys(d for candidates in pools for d in candidates))}
    texts = embed_captions(encoder, list(row))
    scores = [texts[[row[d] for d in candidates]] @ image for candidates, image in zip(pools, images, strict=True)]
    return np.array([(~(own[1:] < own[0])).sum() for own in scores])


def attack(encoder: Encoder, images: Array, texts: Array, right: Array, *, radius: float, steps: int = 10) -> Array:
    """Pictures moved within an L2 ball to where their caption loses against the others (projected gradient ascent).

    Args:
      images: [n, size, size, 3]. texts: unit vectors [m, dim]. right: [n] index of each picture's caption.
    """

    def loss(x: Array) -> Array:
        logits = 30 * encoder.encode_image(encoder.params, x) @ texts.T
        return -jnp.take_along_axis(jax.nn.log_softmax(logits), right[:, None], 1).sum()

    @jax.jit
    def step(moved: Array) -> Array:
        slope = jax.grad(loss)(jnp.clip(images + moved, 0, 1))
        direction = slope * jax.lax.rsqrt((slope**2).sum((1, 2, 3), keepdims=True) + 1e-20)
        return toward_ball(moved + (0.25 * radius) * direction, jnp.zeros_like(slope), jnp.float32(radius))

    moved = jnp.zeros_like(images)
    for _ in range(steps):
        moved = step(moved)
    return jnp.clip(images + moved, 0, 1)

"""What a model has learned: retrieval of the right caption among many, clean and under attack."""

from __future__ import annotations

from collections.abc import Sequence

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


def embed_captions(encoder: Encoder, descriptions: Sequence[Description]) -> np.ndarray:
    """Unit vectors [n, dim] of the plain captions."""
    return np.asarray(jax.jit(encoder.encode_text)(encoder.params, encoder.tokenize([describe(d) for d in descriptions])))


def embed_images(encoder: Encoder, images: np.ndarray, *, batch: int = 64) -> np.ndarray:
    """Unit vectors [n, dim]."""
    encode = jax.jit(encoder.encode_image)
    padded = np.concatenate([images, np.zeros((-len(images) % batch, *images.shape[1:]), images.dtype)])
    return np.concatenate([np.asarray(encode(encoder.params, padded[i : i + batch])) for i in range(0, len(padded), batch)])[: len(images)]


def ranks(images: np.ndarray, texts: np.ndarray) -> np.ndarray:
    """For picture i, how many of the captions [m, dim] score above caption i, [n]."""
    scores = images @ texts.T
    return (scores > scores[np.arange(len(images)), np.arange(len(images))][:, None]).sum(1)


def hard_ranks(encoder: Encoder, images: np.ndarray, descriptions: Sequence[Description], *, pool: int = 30) -> np.ndarray:
    """For each picture, how many captions of its hard pool score above its own, [n]."""
    results = []
    for image, description in zip(images, descriptions, strict=True):
        candidates = hard_pool(description, pool)
        candidates = [description, *candidates, *[description] * (pool - len(candidates))]
        scores = embed_captions_cached(encoder, candidates) @ image
        results.append((scores[1:] > scores[0]).sum())
    return np.array(results)


_CACHE: dict[tuple[str, str], np.ndarray] = {}


def embed_captions_cached(encoder: Encoder, descriptions: Sequence[Description]) -> np.ndarray:
    """As `embed_captions`, for captions that come again and again."""
    missing = list(dict.fromkeys(d for d in descriptions if (encoder.digest, describe(d)) not in _CACHE))
    if missing:
        for description, vector in zip(missing, embed_captions(encoder, missing), strict=True):
            _CACHE[encoder.digest, describe(description)] = vector
    return np.stack([_CACHE[encoder.digest, describe(d)] for d in descriptions])


def attack(encoder: Encoder, images: Array, texts: Array, right: Array, *, radius: float, steps: int = 10) -> Array:
    """Pictures moved within an L2 ball to where their caption loses against the others (projected gradient ascent).

    Args:
      images: [n, size, size, 3]. texts: unit vectors [m, dim]. right: [n] index of each picture's caption.
    """

    def loss(x):
        logits = 30 * encoder.encode_image(encoder.params, x) @ texts.T
        return -jnp.take_along_axis(jax.nn.log_softmax(logits), right[:, None], 1).sum()

    @jax.jit
    def step(moved):
        slope = jax.grad(loss)(jnp.clip(images + moved, 0, 1))
        direction = slope * jax.lax.rsqrt((slope**2).sum((1, 2, 3), keepdims=True) + 1e-20)
        return toward_ball(moved + (0.25 * radius) * direction, jnp.zeros_like(slope), radius)

    moved = jnp.zeros_like(images)
    for _ in range(steps):
        moved = step(moved)
    return jnp.clip(images + moved, 0, 1)

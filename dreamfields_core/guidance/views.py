"""Captions that depend on where the camera stands, and captions in several wordings.

One caption at all angles repeats its pattern on every side (a face in front and behind). Naming the side in the caption, as
DreamFusion does (Poole 2022, section 3.2), tells the model which one it looks at.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.types import Array, Encoder

VIEWS = ("front view", "side view", "back view", "overhead view")
OVERHEAD = np.deg2rad(60.0)
"""Elevation above which a camera looks from overhead."""
FRONT = -np.pi / 2
"""Azimuth from which the front is seen, radians: it looks along Y, as modelling programs have it, and the exported file then faces
its own front (glTF 2.0, section 3.4: +Z with Y up)."""

PLAIN = ("{}",)
TEMPLATES = ("{}", "a photo of {}", "a 3D render of {}", "a close-up photo of {}", "{}, centered, on a plain background")
"""Wordings whose embeddings are averaged: the mean says less of the wording and more of the thing."""


def view_captions(caption: str) -> tuple[str, ...]:
    """The caption with each of VIEWS appended, in their order."""
    return tuple(f"{caption.rstrip(' .')}, {view}" for view in VIEWS)


def caption_embedding(encoder: Encoder, caption: str, *, templates: Sequence[str] = PLAIN) -> Array:
    """The mean of the wordings' unit vectors, at length 1: [dim]; of a single wording, that vector itself.

    Raises:
      ValueError: no templates, or one without {}.
    """
    return _means(encoder, [caption], templates)[0]


def view_embeddings(encoder: Encoder, caption: str, *, templates: Sequence[str] = PLAIN) -> Array:
    """One unit vector for each of VIEWS: [4, dim]. Raises: as `caption_embedding`."""
    return _means(encoder, view_captions(caption), templates)


def _means(encoder: Encoder, captions: Sequence[str], templates: Sequence[str]) -> Array:
    if not templates or not all("{}" in template for template in templates):
        raise ValueError(f'expected templates that say with {{}} where the caption goes, got {list(templates)}: write "a photo of {{}}"')
    wordings = [template.replace("{}", caption) for caption in captions for template in templates]
    vectors = jax.jit(encoder.encode_text)(encoder.params, jnp.asarray(encoder.tokenize(wordings)))
    if len(templates) == 1:
        return vectors
    means = jnp.mean(vectors.reshape(len(captions), len(templates), -1), axis=1)
    return means / jnp.linalg.norm(means, axis=1, keepdims=True)


def view_index(azimuth: Array, elevation: Array, *, front: float = FRONT) -> Array:
    """Which of VIEWS each camera has, int [V]: a quarter turn each for front and back, the two quarters between for the side.

    Args:
      azimuth, elevation: [V] radians.
      front: azimuth from which the front is seen, radians.
    """
    away = jnp.abs(jnp.mod(azimuth - front + jnp.pi, 2 * jnp.pi) - jnp.pi)
    around = jnp.where(away <= jnp.pi / 4, 0, jnp.where(away < 3 * jnp.pi / 4, 1, 2))
    return jnp.where(elevation > OVERHEAD, 3, around)


def embedding_at(embeddings: Array, azimuth: Array, elevation: Array, *, front: float = FRONT) -> Array:
    """The unit vector for each camera, [V, dim], of those in `view_embeddings` [4, dim]; a single [dim] serves every camera."""
    if embeddings.ndim == 1:
        return jnp.broadcast_to(embeddings, (*azimuth.shape, embeddings.shape[-1]))
    return embeddings[view_index(azimuth, elevation, front=front)]

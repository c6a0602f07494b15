"""Captions that depend on where the camera stands, and captions in several wordings.

One caption at all angles repeats its pattern on every side (a face in front and behind). Naming the side in the caption, as
DreamFusion does (Poole 2022, section 3.2), tells the model which one it looks at.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from dreamfields_core.types import Array, Encoder

VIEWS = ("front view", "side view", "back view", "overhead view")
OVERHEAD = np.deg2rad(60.0)
"""Elevation above which a camera looks from overhead."""

PLAIN = ("{}",)
TEMPLATES = ("{}", "a photo of {}", "a 3D render of {}", "a close-up photo of {}", "{}, centered, on a plain background")
"""Wordings whose embeddings are averaged: the mean says less of the wording and more of the thing."""


def view_captions(caption: str) -> tuple[str, ...]:
    """The caption with each of VIEWS appended, in their order."""
    return tuple(f"{caption.rstrip(' .')}, {view}" for view in VIEWS)


def caption_embedding(encoder: Encoder, caption: str, *, templates: Sequence[str] = PLAIN) -> Array:
    """The mean of the wordings' unit vectors, at length 1: [dim].

    Raises:
      ValueError: no templates, or one without {}.
    """
    if not templates or not all("{}" in template for template in templates):
        raise ValueError(f'expected templates that say with {{}} where the caption goes, got {list(templates)}: write "a photo of {{}}"')
    tokens = jnp.asarray(encoder.tokenize([template.replace("{}", caption) for template in templates]))
    mean = jnp.mean(encoder.encode_text(encoder.params, tokens), axis=0)
    return mean / jnp.linalg.norm(mean)


def view_embeddings(encoder: Encoder, caption: str, *, templates: Sequence[str] = PLAIN) -> Array:
    """One unit vector for each of VIEWS: [4, dim]."""
    return jnp.stack([caption_embedding(encoder, each, templates=templates) for each in view_captions(caption)])


def view_index(azimuth: Array, elevation: Array, *, front: float = 0.0) -> Array:
    """Which of VIEWS each camera has, int [V]: a quarter turn each for front and back, the two quarters between for the side.

    Args:
      azimuth, elevation: [V] radians.
      front: azimuth from which the front is seen, radians.
    """
    away = jnp.abs(jnp.mod(azimuth - front + jnp.pi, 2 * jnp.pi) - jnp.pi)
    around = jnp.where(away <= jnp.pi / 4, 0, jnp.where(away < 3 * jnp.pi / 4, 1, 2))
    return jnp.where(elevation > OVERHEAD, 3, around)


def embedding_at(embeddings: Array, azimuth: Array, elevation: Array, *, front: float = 0.0) -> Array:
    """The unit vector for each camera, [V, dim], of those in `view_embeddings` [4, dim]; a single [dim] serves every camera."""
    if embeddings.ndim == 1:
        return jnp.broadcast_to(embeddings, (*azimuth.shape, embeddings.shape[-1]))
    return embeddings[view_index(azimuth, elevation, front=front)]

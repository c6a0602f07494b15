"""What a dream minimises (paper sections 3.2 and 4.4)."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array


def similarity(image_embeddings: Array, text_embedding: Array) -> Array:
    """Mean cosine of unit vectors [B, dim] with the caption's [dim], or with one each [B, dim].

    Minus this is the paper's L_CLIP (equation 4).
    """
    if text_embedding.ndim == 2:
        return jnp.mean(jnp.sum(image_embeddings * text_embedding, axis=1))
    return jnp.mean(jnp.matmul(image_embeddings, text_embedding, precision=jax.lax.Precision.HIGHEST))


def clipped_transmittance(transmittance: Array, target: Array) -> Array:
    """L_T = -min(tau, mean T), paper equation 5, averaged over views.

    Args:
      transmittance: [V, H, W] in [0, 1].
      target: [V], tau of each view.
    """
    return -jnp.mean(jnp.minimum(target, jnp.mean(transmittance, axis=(1, 2))))

"""What a dream minimises (paper sections 4.2, 4.5 and 5.4).

Symbols: T transmittance of each pixel, [V, H, W] in [0, 1]; tau target of each view, [V]; cosines of the pictures with the caption, [B],
each view's copies one after another, minus their mean being L_CLIP.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.config import LossConfig
from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array

CLEAREST = 1e-6
"""Both logarithms of the beta prior stop this far from 0 and 1; beyond, a ray is as decided as it can be and is left alone."""


def cosines(image_embeddings: Array, text_embedding: Array) -> Array:
    """Cosines [B] of unit vectors [B, dim] with the caption's [dim], or with one each [B, dim]."""
    image_embeddings, text_embedding = in_float32((image_embeddings, text_embedding))
    if text_embedding.ndim == 2:
        return jnp.sum(image_embeddings * text_embedding, axis=1)
    return jnp.matmul(image_embeddings, text_embedding, precision=jax.lax.Precision.HIGHEST)


def regularized(cosines: Array, transmittance: Array, target: Array, loss: LossConfig) -> Array:
    """L_total with the regulariser that `loss` names (paper table 2); []. Density noise acts in the rendering and adds nothing here."""
    cosines, transmittance, target = in_float32((cosines, transmittance, target))
    match loss.regularizer:
        case "clipped_additive":
            return -jnp.mean(cosines) + loss.transmittance * clipped_transmittance(transmittance, target)
        case "clipped_gated":
            return clipped_gated(cosines, transmittance, target)
        case "gated":
            return gated(cosines, transmittance)
        case "beta_prior":
            return -jnp.mean(cosines) + loss.beta * beta_prior(transmittance)
    return -jnp.mean(cosines)


def clipped_transmittance(transmittance: Array, target: Array) -> Array:
    """L_T = -min(tau, mean T), paper equation 8, averaged over views."""
    transmittance, target = in_float32((transmittance, target))
    return -jnp.mean(jnp.minimum(target, jnp.mean(transmittance, axis=(1, 2))))


def clipped_gated(cosines: Array, transmittance: Array, target: Array) -> Array:
    """min(tau, mean T) L_CLIP of each view, averaged over views (paper equation 11)."""
    gate = jnp.minimum(target, jnp.mean(transmittance, axis=(1, 2)))
    return -jnp.mean(gate * by_view(cosines, views=gate.shape[0]))


def gated(cosines: Array, transmittance: Array) -> Array:
    """mean(T) L_CLIP of each view, averaged over views (Mordvintsev et al. 2018; paper table 2, whose row has one minus too many:
    it would drive pictures away from their caption)."""
    gate = jnp.mean(transmittance, axis=(1, 2))
    return -jnp.mean(gate * by_view(cosines, views=gate.shape[0]))


def beta_prior(transmittance: Array) -> Array:
    """mean(log T + log(1 - T)) (Neural Volumes, Lombardi et al. 2019; paper equation 10): least where rays pass or are stopped wholly."""
    clear = jnp.clip(transmittance, CLEAREST, 1.0 - CLEAREST)
    return jnp.mean(jnp.log(clear) + jnp.log1p(-clear))


def by_view(cosines: Array, *, views: int) -> Array:
    """The mean over each view's copies, [V]."""
    return jnp.mean(cosines.reshape(views, -1), axis=1)

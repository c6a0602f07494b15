"""From a rendered view to the pictures that the guidance sees: backgrounds and crops (paper sections 4.4 and 4.5)."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.config import AugmentConfig
from dreamfields_core.dreaming.backgrounds import random_background
from dreamfields_core.rendering.compositing import over
from dreamfields_core.types import Array, Rendering


def random_crop(key: Array, picture: Array, *, crop: int) -> Array:
    """A square of `crop` pixels a side out of [H, W, C]; every offset, the last one too, is as likely."""
    room = picture.shape[0] - crop
    offset = jax.random.randint(key, (2,), 0, room + 1)
    return jax.lax.dynamic_slice(picture, (offset[0], offset[1], 0), (crop, crop, picture.shape[2]))


def augmented_copies(key: Array, views: Rendering, *, augment: AugmentConfig, crop: int) -> Array:
    """Stand every view on `augment.copies` random backgrounds and crop each at random.

    Args:
      views: shape [V, H, W].

    Returns:
      [V * copies, crop, crop, 3].
    """
    count, size = views.transmittance.shape[:2]

    def one(copy_key: Array, view: Rendering) -> Array:
        background_key, crop_key = jax.random.split(copy_key)
        picture = over(view, random_background(background_key, size=size, augment=augment))
        return random_crop(crop_key, picture, crop=crop)

    keys = jax.random.split(key, (count, augment.copies))
    pictures = jax.vmap(lambda view_keys, view: jax.vmap(lambda copy_key: one(copy_key, view))(view_keys))(keys, views)
    return jnp.clip(pictures.reshape(-1, crop, crop, 3), 0.0, 1.0)

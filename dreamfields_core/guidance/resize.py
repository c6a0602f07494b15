"""Antialiased bilinear resizing, as two matrix products: exact, differentiable, and cheap on any device."""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.types import Array


@lru_cache(maxsize=64)
def weights(source: int, target: int) -> np.ndarray:
    """Share of each source sample in each target sample, [target, source] float32; rows sum to 1.

    A triangle whose half-width is one pixel of the coarser grid, as Pillow and `jax.image.resize` have it.
    """
    scale = source / target
    width = max(scale, 1.0)
    centre = (np.arange(target)[:, None] + 0.5) * scale - 0.5
    tent = np.maximum(0.0, 1.0 - np.abs(centre - np.arange(source)[None, :]) / width)
    return (tent / tent.sum(1, keepdims=True)).astype(np.float32)


def resize(images: Array, size: int) -> Array:
    """Square pictures of another size.

    Args:
      images: [batch, height, width, channels].
      size: height and width of the result, at least 1.
    Returns: [batch, size, size, channels], in the range that went in.
    Raises:
      ValueError: not four axes.
    """
    if images.ndim != 4:
        raise ValueError(f"expected images [batch, height, width, channels], got shape {images.shape}: add the batch axis")
    _, height, width, _ = images.shape
    if (height, width) == (size, size):
        return images
    rows, columns = weights(height, size), weights(width, size)
    return jnp.einsum("ih,bhwc,jw->bijc", rows, images, columns, precision=jax.lax.Precision.HIGHEST)

"""From a picture in [0, 1] to what an image tower was trained on, with a gradient.

Resizing is two products with small matrices, which hold exactly the weights that Pillow (and PyTorch with antialias) gives to its
samples. Published models were trained on pictures rounded to 8 bits after each of the two; `eight_bits` does the same, and its
gradient passes as if nothing had been rounded.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.guidance.architecture import Pixels
from dreamfields_core.types import Array

Method = Literal["bicubic", "bilinear"]


def kernel(method: Method, x: np.ndarray) -> np.ndarray:
    """The interpolating kernel at distance x >= 0 samples: a triangle, or Keys' cubic (1981, equation 4) with a = -1/2."""
    if method == "bilinear":
        return np.maximum(1.0 - x, 0.0)
    near = (1.5 * x - 2.5) * x * x + 1.0
    far = ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    return np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))


@lru_cache(maxsize=64)
def resize_matrix(source: int, target: int, method: Method, antialias: bool = True) -> np.ndarray:
    """[target, source] float32: each row the weights of the source's samples in one sample of the target; rows sum to 1.

    When shrinking, the kernel is widened by the ratio, unless antialias is off. Samples beyond the edge are left out.
    """
    ratio = source / target
    widen = max(ratio, 1.0) if antialias else 1.0
    support = (1.0 if method == "bilinear" else 2.0) * widen
    centre = (np.arange(target) + 0.5)[:, None] * ratio
    place = np.arange(source)[None, :]
    weights = kernel(method, np.abs(place - centre + 0.5) / widen)
    # Pillow's window: the kernel is asked only at samples whose rounded distance is within its support.
    first, last = np.floor(np.maximum(centre - support + 0.5, 0)), np.floor(np.minimum(centre + support + 0.5, source))
    weights = np.where((place >= first) & (place < last), weights, 0.0)
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


def scaled_size(height: int, width: int, pixels: Pixels) -> tuple[int, int]:
    """Height and width after resizing, before the centre is cut out."""
    if pixels.fit == "squash":
        return pixels.size, pixels.size
    short, long = min(height, width), max(height, width)
    longer = int(pixels.size * long / short)
    return (pixels.size, longer) if height <= width else (longer, pixels.size)


def resized(images: Array, pixels: Pixels, *, eight_bits: bool = False) -> Array:
    """[batch, H, W, 3] in [0, 1] -> [batch, size, size, 3] in [0, 1]; a picture of the right size is not touched.

    The cubic kernel overshoots at edges; like the 8-bit pictures of training, the result is clipped, with the gradient of no clipping.
    """
    _, height, width, _ = images.shape
    tall, wide = scaled_size(height, width, pixels)
    if wide != width:
        across = resize_matrix(width, wide, pixels.method, pixels.antialias)
        images = _held(jnp.einsum("bhwc,vw->bhvc", images, across, precision="highest"), eight_bits)
    if tall != height:
        down = resize_matrix(height, tall, pixels.method, pixels.antialias)
        images = _held(jnp.einsum("bhvc,uh->buvc", images, down, precision="highest"), eight_bits)
    top, left = (tall - pixels.size) // 2, (wide - pixels.size) // 2
    return images[:, top : top + pixels.size, left : left + pixels.size]


def prepared(images: Array, pixels: Pixels, *, eight_bits: bool = False) -> Array:
    """Resized, then (x - mean) / std per channel.

    Raises:
      ValueError: no [batch, H, W, 3].
    """
    if images.ndim != 4 or images.shape[-1] != 3:
        raise ValueError(f"expected images [batch, height, width, 3] in [0, 1], got shape {images.shape}: add the batch axis or drop alpha")
    mean, std = np.array(pixels.mean, np.float32), np.array(pixels.std, np.float32)
    images = resized(jnp.asarray(images, jnp.float32), pixels, eight_bits=eight_bits)
    return (images - mean[None, None, None]) / std[None, None, None]


def _held(images: Array, eight_bits: bool) -> Array:
    """Clipped to [0, 1], and rounded to 1/255 where wanted, while the gradient passes straight through."""
    held = jnp.clip(images, 0.0, 1.0)
    if eight_bits:
        held = jnp.floor(held * 255.0 + 0.5) / 255.0
    return images + jax.lax.stop_gradient(held - images)

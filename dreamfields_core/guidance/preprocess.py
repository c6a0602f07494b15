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
BITS = 22
"""Of Pillow's weights behind the point: what is left of 32 beside 8 for the pixel and 2 for overshoot."""


def kernel(method: Method, x: np.ndarray) -> np.ndarray:
    """The interpolating kernel at distance x >= 0 samples: a triangle, or Keys' cubic (1981, equation 4) with a = -1/2."""
    if method == "bilinear":
        return np.maximum(1.0 - x, 0.0)
    near = (1.5 * x - 2.5) * x * x + 1.0
    far = ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    return np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))


@lru_cache(maxsize=64)
def resize_matrix(source: int, target: int, method: Method, antialias: bool = True) -> np.ndarray:
    """[target, source] float64: each row the weights of the source's samples in one sample of the target; rows sum to 1.

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
    return weights / weights.sum(axis=1, keepdims=True)


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
    passes = [("bhwc,vw->bhvc", width, wide), ("bhwc,uh->buwc", height, tall)]
    if tall < height and wide > width:
        passes.reverse()  # as Pillow: across first, unless down is the pass that shrinks
    for axes, before, after in passes:
        if before != after:
            images = _product(axes, images, resize_matrix(before, after, pixels.method, pixels.antialias), eight_bits)
    top, left = (tall - pixels.size) // 2, (wide - pixels.size) // 2
    images = images[:, top : top + pixels.size, left : left + pixels.size]
    return images + jax.lax.stop_gradient(jnp.clip(images, 0.0, 1.0) - images)


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


def _product(axes: str, images: Array, matrix: np.ndarray, eight_bits: bool) -> Array:
    """One pass; where wanted the value is clipped and rounded, while the gradient is that of the product alone."""
    smooth = jnp.einsum(axes, images, matrix.astype(np.float32), precision="highest")
    if not eight_bits:
        return smooth
    # As Pillow does it: weights in units of 2^-22, so that the sum is exact in 32 bits and ties fall the same way.
    whole = jnp.round(jax.lax.stop_gradient(images) * 255.0).astype(jnp.int32)
    weights = np.trunc(matrix * (1 << BITS) + np.where(matrix < 0, -0.5, 0.5)).astype(np.int32)
    summed = jnp.einsum(axes, whole, weights, preferred_element_type=jnp.int32) + (1 << (BITS - 1))
    exact = jnp.clip(jax.lax.shift_right_arithmetic(summed, BITS), 0, 255).astype(jnp.float32) / 255.0
    return smooth + jax.lax.stop_gradient(exact - smooth)

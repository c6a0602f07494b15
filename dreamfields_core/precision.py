"""Which numbers a device computes with.

Geometry, encodings, optical depths and losses are float32 with the highest matrix precision on every device. Only the large
matrix products of a field may round their factors to bfloat16, and only where the device has units for it: measured on a CPU,
bfloat16 products are emulated and slower than float32.
"""

from __future__ import annotations

from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

Products = Literal["auto", "float32", "bfloat16"]

FASTER_IN_BFLOAT16 = frozenset({"gpu", "cuda", "rocm", "tpu"})
"""Platforms, as JAX names them, whose matrix units multiply bfloat16 at several times the rate of float32."""


def product_type(wanted: Products, platform: str) -> np.dtype:
    """Type of the factors of large matrix products: as wanted, or for "auto" what is fastest on the platform."""
    if wanted == "auto":
        wanted = "bfloat16" if platform in FASTER_IN_BFLOAT16 else "float32"
    return np.dtype(jnp.dtype(wanted))


def in_float32(tree: Any) -> Any:
    """The same arrays with half-precision floats widened; whole numbers and wider floats stay as they are.

    What comes in as bfloat16 or float16 (cached features, another program's rays) is exact in float32, and no sum along a ray or
    over a picture is ever taken in eight bits of mantissa.
    """
    return jax.tree.map(_widened, tree)


def _widened(leaf: Any) -> Any:
    narrow = jnp.issubdtype(leaf.dtype, jnp.floating) and leaf.dtype.itemsize < 4
    return leaf.astype(jnp.float32) if narrow else leaf

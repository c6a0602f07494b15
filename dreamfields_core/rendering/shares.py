"""A picture's rays dealt out to several devices like cards, so that each has its part of the object and of the emptiness around it.

A ray has the same random numbers whoever renders it: what one device gives and what several give differs only by rounding.
"""

from __future__ import annotations

import flax.struct
import jax

from dreamfields_core.types import Array


@flax.struct.dataclass
class Share:
    """Rays number first, first + of, first + 2 of, ... of a picture.

    first: [] int32. of: how many shares there are. axis: name of the mesh's axis along which they lie.
    """

    first: Array
    of: int = flax.struct.field(pytree_node=False)
    axis: str = flax.struct.field(pytree_node=False)


def uniform(key: Array, shape: tuple[int, ...], share: Share | None) -> Array:
    """Numbers in [0, 1) for the rays of a share, [R, S] = `shape`; None means that the share is everything.

    The numbers of all rays are asked for and those of others dropped: the generator counts, it does not walk, so that a compiler
    computes only what is read.
    """
    if share is None:
        return jax.random.uniform(key, shape)
    whole = jax.random.uniform(key, (shape[0], share.of, shape[1]))
    return jax.lax.dynamic_index_in_dim(whole, share.first, axis=1, keepdims=False)


def total(part: Array, share: Share | None) -> Array:
    """The sum over all shares of what each has for itself."""
    return part if share is None else jax.lax.psum(part, share.axis)  # type: ignore[no-any-return]

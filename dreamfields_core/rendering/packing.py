"""Ask the field only where it matters: the chosen samples are packed and evaluated chunk by chunk.

Of N samples a mask keeps M. The loop over ceil(M / chunk) chunks has a trip count that is known only while running, so one
compiled program serves empty and full scenes: no bucket overflows and nothing is dropped. The gradient runs such a loop
again, over the kept samples whose values the loss depends on at all, and evaluates each chunk anew, so that memory is that of one
chunk however many samples there are.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array, Gaussians, Params

Apply = Callable[[Params, Gaussians], tuple[Array, Array]]
GaussiansAt = Callable[[Any, Array], Gaussians]

MOST = 2**31 - 1
"""Samples are numbered in int32."""


def chunk_size(wanted: int | None) -> int:
    """`wanted`, or what suits this process's device: on a CPU 1 024, whose activations stay in its caches, elsewhere 65 536."""
    return wanted or (1024 if jax.default_backend() == "cpu" else 65536)


@partial(jax.custom_vjp, nondiff_argnums=(0, 1, 2))
def evaluate_packed(
    apply: Apply, gaussians_at: GaussiansAt, chunk: int, prepared: Params, samples: Any, mask: Array
) -> tuple[Array, Array]:
    """The field at the samples that `mask` keeps.

    Args:
      apply: the field, (prepared, gaussians [n]) -> raw [n], color [n, 3].
      gaussians_at: (samples, flat indices [n]) -> gaussians [n].
      chunk: samples evaluated at once.
      prepared: the field's parameters; differentiated.
      samples: whatever `gaussians_at` reads; not differentiated.
      mask: [N] bool.

    Returns:
      raw [N] and color [N, 3], float32 whatever the field computes in; zeros where the mask is False.

    Raises:
      ValueError: more samples than can be numbered.
    """
    if mask.size > MOST:
        raise ValueError(f"expected at most {MOST} samples at once, got {mask.size}: render fewer rays at a time, or fewer samples a ray")
    return _forward(apply, gaussians_at, chunk, prepared, samples, mask)[0]


def _forward(
    apply: Apply, gaussians_at: GaussiansAt, chunk: int, prepared: Params, samples: Any, mask: Array
) -> tuple[tuple[Array, Array], Any]:
    if mask.size == 0:
        return (jnp.zeros(0), jnp.zeros((0, 3))), (prepared, samples, mask)
    counts = jnp.cumsum(mask, dtype=jnp.int32)
    capacity = -(-mask.shape[0] // chunk) * chunk

    def body(begin: Array, packed: Array) -> Array:
        index, _ = _kept(counts, begin, chunk)
        raw, color = apply(prepared, gaussians_at(samples, index))
        rows = jnp.concatenate(in_float32([raw[:, None], color]), axis=-1)
        return jax.lax.dynamic_update_slice(packed, rows, (begin, 0))

    packed = _over_chunks(counts, chunk, body, jnp.zeros((capacity, 4)))
    spread = jnp.where(mask[:, None], packed[jnp.maximum(counts - 1, 0)], 0.0)
    return (spread[:, 0], spread[:, 1:]), (prepared, samples, mask)


def _backward(apply: Apply, gaussians_at: GaussiansAt, chunk: int, saved: Any, gradient: tuple[Array, Array]) -> tuple[Params, Any, Any]:
    prepared, samples, mask = saved
    raw_gradient, color_gradient = gradient
    # Not a number is unlike zero, so what has gone wrong is carried on.
    counts = jnp.cumsum(mask & ((raw_gradient != 0) | jnp.any(color_gradient != 0, axis=-1)), dtype=jnp.int32)
    # Added up in float32: in half precision a sum of many chunks stops growing once a chunk is a thousandth of it.
    nothing = jax.tree.map(lambda leaf: in_float32(jnp.zeros_like(leaf)), prepared)

    def body(begin: Array, total: Params) -> Params:
        index, kept = _kept(counts, begin, chunk)
        gaussians = gaussians_at(samples, index)
        (raw_here, color_here), pull = jax.vjp(lambda values: apply(values, gaussians), prepared)
        raw = jnp.where(kept, raw_gradient[index], 0.0).astype(raw_here.dtype)
        color = jnp.where(kept[:, None], color_gradient[index], 0.0).astype(color_here.dtype)
        return jax.tree.map(jnp.add, total, in_float32(pull((raw, color))[0]))

    total = _over_chunks(counts, chunk, body, nothing) if mask.size else nothing
    total = jax.tree.map(lambda summed, leaf: summed.astype(leaf.dtype), total, prepared)
    return total, jax.tree.map(_no_gradient, samples), _no_gradient(mask)


evaluate_packed.defvjp(_forward, _backward)


def _kept(counts: Array, begin: Array, chunk: int) -> tuple[Array, Array]:
    """Flat indices [chunk] of the kept samples number begin, begin + 1, ... and which of them exist.

    The others repeat the last kept sample: a field may have no finite value where it was not asked.
    """
    number = begin + jnp.arange(1, chunk + 1, dtype=jnp.int32)
    index = jnp.searchsorted(counts, jnp.minimum(number, counts[-1]), side="left").astype(jnp.int32)
    return index, number <= counts[-1]


def _over_chunks(counts: Array, chunk: int, body: Callable[[Array, Any], Any], initial: Any) -> Any:
    """Run body(begin, carry) for begin = 0, chunk, 2 chunk, ... below the number of kept samples."""

    def more(state: tuple[Array, Any]) -> Array:
        return state[0] < counts[-1]

    def advance(state: tuple[Array, Any]) -> tuple[Array, Any]:
        begin, carry = state
        return begin + chunk, body(begin, carry)

    return jax.lax.while_loop(more, advance, (jnp.int32(0), initial))[1]


def _no_gradient(value: Array) -> Any:
    if jnp.issubdtype(value.dtype, jnp.inexact):
        return jnp.zeros_like(value)
    return np.zeros(value.shape, jax.dtypes.float0)

"""A field whose raw density is disturbed at random, anew at every sample (NeRF, appendix A; paper table 2, "perturb sigma").

It is wrapped around any field and rendered in its place, so the renderer knows nothing of it. A sample's noise is drawn from the key and
the bits of its position: the same whoever evaluates it, once or, for the gradient, again.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp

from dreamfields_core.fields.contract import Field
from dreamfields_core.types import Array, Gaussians, Params


def perturbed(field: Field) -> Field:
    """The same field, of which `apply` and `normals` take what `perturb` gives."""

    def apply(prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        raw, colors = field.apply(prepared["field"], gaussians)
        return raw + prepared["deviation"] * _noise(prepared["seed"], gaussians.means), colors

    return dataclasses.replace(field, apply=apply)


def perturb(key: Array, prepared: Params, deviation: Array) -> Params:
    """What a perturbed field reads: the prepared parameters, [] standard deviation of the noise, and a seed.

    The seed is whole numbers written as floats, since all that a field reads is differentiated.
    """
    seed = jax.random.randint(key, (2,), 0, 2**24).astype(jnp.float32)
    return {"field": prepared, "deviation": jnp.asarray(deviation, jnp.float32), "seed": seed}


def _noise(seed: Array, points: Array) -> Array:
    """Standard normal numbers [N] for points [N, 3]."""
    whole = jax.lax.stop_gradient(seed).astype(jnp.uint32)
    key = jax.random.fold_in(jax.random.key(whole[0]), whole[1])
    bits = jax.lax.bitcast_convert_type(jax.lax.stop_gradient(points), jnp.uint32)

    def one(place: Array) -> Array:
        return jax.random.normal(jax.random.fold_in(jax.random.fold_in(jax.random.fold_in(key, place[0]), place[1]), place[2]))

    return jax.vmap(one)(bits)

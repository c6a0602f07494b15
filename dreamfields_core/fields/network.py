"""A network as pure functions of its weights: split once, merged where it is asked."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
from flax import nnx
from jax.typing import DTypeLike

from dreamfields_core.fields.contract import Field
from dreamfields_core.types import Array, Gaussians, Params

Make = Callable[[nnx.Rngs], nnx.Module]
"""A network of fresh weights: called with Gaussians [N] it gives a number [N] and a colour [N, 3] for each."""
Ask = Callable[[Params, Gaussians], tuple[Array, Array]]


def dense(into: int, out: int, rngs: nnx.Rngs, *, products: DTypeLike = jnp.float32) -> nnx.Linear:
    """A layer whose matrix product has factors of type `products`; float32 ones are kept whole, which accelerators would else round."""
    exact = jnp.dtype(products) == jnp.float32
    return nnx.Linear(into, out, dtype=products, precision=jax.lax.Precision.HIGHEST if exact else None, rngs=rngs)


def as_functions(make: Make) -> tuple[Callable[[Array], Params], Ask]:
    """init: key -> params, a dictionary of arrays. ask: (params, gaussians [N]) -> what the network gives."""
    graph = nnx.graphdef(nnx.eval_shape(lambda: make(nnx.Rngs(0))))

    def init(key: Array) -> Params:
        return nnx.to_pure_dict(nnx.state(make(nnx.Rngs(params=key))))

    def ask(params: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        return nnx.merge(graph, nnx.State(params))(gaussians)  # type: ignore[no-any-return]

    return init, ask


def network_field(make: Make) -> Field:
    """The field whose raw density and colour are what the network gives, without a penalty of its own."""
    init, ask = as_functions(make)
    return Field(init=init, prepare=lambda params: params, apply=ask, penalty=lambda key, prepared: jnp.zeros(()), density_scale=1.0)

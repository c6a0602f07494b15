"""A published model as an `Encoder`: architecture, weights and tokenizer put together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from dreamfields_core.guidance.architecture import Architecture, UnfitModel
from dreamfields_core.guidance.convert import convert, modules
from dreamfields_core.guidance.families import read_tables
from dreamfields_core.guidance.preprocess import prepared
from dreamfields_core.guidance.tokens import Tokenize
from dreamfields_core.types import Array, Encoder, Params

BOTH = ("image", "text")


def read_weights(arrays: Mapping[str, np.ndarray], arch: Architecture, *, towers: Collection[str] = BOTH) -> Params:
    """The parameters of the wanted towers from the arrays of a file. Raises: UnfitModel."""
    tables, ignored = read_tables(arch, arrays.keys())
    return convert(arrays, arch, tables, towers=towers, ignored=ignored)


def encoder(name: str, digest: str, arch: Architecture, params: Params, tokenize: Tokenize, *, eight_bits: bool = False) -> Encoder:
    """The `Encoder` of a model whose weights are loaded; a tower that is not in `params` refuses in one sentence.

    Args:
      eight_bits: round resized pictures as the published preprocessing does (preprocess.py).
    """
    graphs = {tower: nnx.graphdef(module) for tower, module in modules(arch).items()}

    def tower(params: Params, which: str) -> Callable[[Array], Array]:
        if which not in params:
            raise UnfitModel(f"expected {name} with its {which} tower, got it loaded without: load it again with both")
        return nnx.merge(graphs[which], nnx.State(params[which]))

    def encode_text(params: Params, tokens: Array) -> Array:
        return unit(tower(params, "text")(jnp.asarray(tokens, jnp.int32)))

    def encode_image(params: Params, images: Array) -> Array:
        return unit(tower(params, "image")(prepared(images, arch.pixels, eight_bits=eight_bits)))

    return Encoder(
        name=name,
        digest=digest,
        image_size=arch.pixels.size,
        dim=arch.dim,
        params=params,
        tokenize=tokenize,
        encode_text=encode_text,
        encode_image=encode_image,
    )


def unit(vectors: Array) -> Array:
    """Vectors [..., dim] at length 1; the zero vector stays zero, with a finite gradient."""
    squared = jnp.sum(vectors * vectors, axis=-1, keepdims=True)
    return vectors / jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0))


def match_probability(params: Params, cosines: Array) -> Array:
    """SigLIP: probability that picture and caption belong together, sigmoid(e^scale cosine + bias) (Zhai 2023, section 3.2).

    Raises:
      UnfitModel: a model that was trained without a bias, whose cosines only rank.
    """
    scoring = params["scoring"]
    if "bias" not in scoring:
        raise UnfitModel("expected a model trained on pairs (SigLIP), got one whose cosines only rank: compare captions instead")
    return jax.nn.sigmoid(jnp.exp(scoring["scale"].astype(jnp.float32)) * cosines + scoring["bias"].astype(jnp.float32))

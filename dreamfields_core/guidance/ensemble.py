"""Several image-text models as one.

The embeddings are laid side by side, each times the square root of its weight. As the weights sum to 1, the result is of unit length,
and the cosine of two such vectors is the weighted mean of the models' own cosines; so an ensemble is an `Encoder` like any other.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from dreamfields_core.types import Array, Encoder, Params

SHARE, SIGN = "*", "+"


def split_name(name: str) -> list[tuple[str, float]]:
    """ "clip-vit-b16+siglip2-base-patch16-256*0.5" -> names and weights, 1 where none is given.

    Raises:
      ValueError: a weight that is no positive number, or an empty name.
    """
    parts = []
    for part in name.split(SIGN):
        model, _, share = part.strip().rpartition(SHARE) if SHARE in part else (part.strip(), "", "1")
        try:
            weight = float(share)
        except ValueError:
            weight = -1.0
        if not model.strip() or not 0 < weight < float("inf"):
            raise ValueError(f'expected NAME or NAME*WEIGHT with a positive weight, joined by "+", got "{part}" in "{name}"')
        parts.append((model.strip(), weight))
    return parts


def ensemble(members: Sequence[tuple[Encoder, float]]) -> Encoder:
    """One `Encoder` whose cosines are the weighted means of its members'.

    Args:
      members: encoders and their weights, of any positive sum.

    Raises:
      ValueError: no members, or a weight that is not positive.
    """
    if not members or not all(weight > 0 for _, weight in members):
        raise ValueError(f"expected one or more encoders with positive weights, got {[weight for _, weight in members]}")
    encoders = [encoder for encoder, _ in members]
    total = sum(weight for _, weight in members)
    roots = [float(np.sqrt(weight / total)) for _, weight in members]
    lengths = [encoder.tokenize([""]).shape[1] for encoder in encoders]
    ends = np.cumsum(lengths)

    def tokenize(captions: Sequence[str]) -> np.ndarray:
        return np.concatenate([encoder.tokenize(captions) for encoder in encoders], axis=1)

    def encode_text(params: Params, tokens: Array) -> Array:
        rows = [tokens[:, end - length : end] for end, length in zip(ends, lengths)]
        return _beside([encoder.encode_text(own, row) for encoder, own, row in zip(encoders, params, rows)], roots)

    def encode_image(params: Params, images: Array) -> Array:
        return _beside([encoder.encode_image(own, images) for encoder, own in zip(encoders, params)], roots)

    def unknown_words(caption: str) -> tuple[str, ...]:
        return tuple(dict.fromkeys(word for encoder in encoders for word in encoder.unknown_words(caption)))

    said = "\n".join(f"{encoder.digest} {root!r}" for encoder, root in zip(encoders, roots))
    return Encoder(
        name=SIGN.join(f"{encoder.name}{SHARE}{weight:g}" for encoder, weight in members),
        digest=hashlib.sha256(said.encode()).hexdigest(),
        image_size=max(encoder.image_size for encoder in encoders),
        dim=sum(encoder.dim for encoder in encoders),
        params=tuple(encoder.params for encoder in encoders),
        tokenize=tokenize,
        encode_text=encode_text,
        encode_image=encode_image,
        unknown_words=unknown_words,
    )


def _beside(vectors: Sequence[Array], roots: Sequence[float]) -> Array:
    return jnp.concatenate([root * vector for root, vector in zip(roots, vectors)], axis=-1)

"""Several image-text models as one.

The embeddings are laid side by side, each times the square root of its weight. As the weights sum to 1, the result is of unit length,
and the cosine of two such vectors is the weighted mean of the models' own cosines; so an ensemble is an `Encoder` like any other.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from dreamfields_core.guidance.shares import SHARE, SIGN, digest, roots, split_name
from dreamfields_core.types import Array, Encoder, Params

__all__ = ["ensemble", "split_name"]


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
    scales = roots([weight for _, weight in members])
    lengths = [encoder.tokenize(["a"]).shape[1] for encoder in encoders]
    ends = np.cumsum(lengths)

    def tokenize(captions: Sequence[str]) -> np.ndarray:
        return np.concatenate([encoder.tokenize(captions) for encoder in encoders], axis=1)

    def encode_text(params: Params, tokens: Array) -> Array:
        rows = [tokens[:, end - length : end] for end, length in zip(ends, lengths)]
        return _beside([encoder.encode_text(own, row) for encoder, own, row in zip(encoders, params, rows)], scales)

    def encode_image(params: Params, images: Array) -> Array:
        return _beside([encoder.encode_image(own, images) for encoder, own in zip(encoders, params)], scales)

    def unknown_words(caption: str) -> tuple[str, ...]:
        return tuple(dict.fromkeys(word for encoder in encoders for word in encoder.unknown_words(caption)))

    return Encoder(
        name=SIGN.join(f"{encoder.name}{SHARE}{weight:g}" for encoder, weight in members),
        digest=digest([(encoder.digest, weight) for encoder, weight in members]),
        image_size=max(encoder.image_size for encoder in encoders),
        dim=sum(encoder.dim for encoder in encoders),
        params=tuple(encoder.params for encoder in encoders),
        tokenize=tokenize,
        encode_text=encode_text,
        encode_image=encode_image,
        unknown_words=unknown_words,
    )


def _beside(vectors: Sequence[Array], scales: Sequence[float]) -> Array:
    return jnp.concatenate([scale * vector for scale, vector in zip(scales, vectors)], axis=-1)

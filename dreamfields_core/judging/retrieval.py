"""R-Precision (paper section 5.1): does the judge, seeing the pictures, pick the true caption out of many?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.types import Encoder


@dataclass(frozen=True)
class Retrieval:
    """What the judge says of one object.

    similarity: cosine of the first view, the paper's, with the true caption. rank: 1 is best; ties count against.
    correct: rank is 1. similarities, ranks: the same for every view. pool: how many captions there were to choose from.
    """

    similarity: float
    rank: int
    correct: bool
    similarities: tuple[float, ...]
    ranks: tuple[int, ...]
    pool: int


def retrieve(encoder: Encoder, images: np.ndarray, caption: str, pool: Sequence[str]) -> Retrieval:
    """Rank the caption among the pool for every picture.

    Args:
      images: [V, H, W, 3] in [0, 1].
      pool: captions, the true one among them or not (it is added); each counted once.
    """
    others = [other for other in dict.fromkeys(pool) if other != caption]
    texts = jax.jit(encoder.encode_text)(encoder.params, jnp.asarray(encoder.tokenize([caption, *others])))
    pictures = jax.jit(encoder.encode_image)(encoder.params, jnp.asarray(images, jnp.float32))
    # On the host: a device's float32 product may round its factors to ten bits, and ranks hang on less.
    cosines = np.asarray(pictures, np.float64) @ np.asarray(texts, np.float64).T
    ranks = ranks_of_first(cosines)
    return Retrieval(
        similarity=float(cosines[0, 0]),
        rank=int(ranks[0]),
        correct=bool(ranks[0] == 1),
        similarities=tuple(float(value) for value in cosines[:, 0]),
        ranks=tuple(int(rank) for rank in ranks),
        pool=len(others) + 1,
    )


def ranks_of_first(cosines: np.ndarray) -> np.ndarray:
    """Rank of column 0 in every row of [V, P]: 1 + how many others are at least as good. NaN ranks last."""
    first = cosines[:, :1]
    beaten = ~(cosines[:, 1:] < first)
    return 1 + np.sum(beaten, axis=1)


def mean_with_error(values: Sequence[float]) -> tuple[float, float]:
    """Mean and its standard error; the error of a single value is not a number."""
    sample = np.asarray(values, np.float64)
    if sample.size == 0:
        raise ValueError("expected at least one value to average, got none")
    error = float(np.std(sample, ddof=1) / math.sqrt(sample.size)) if sample.size > 1 else math.nan
    return float(np.mean(sample)), error

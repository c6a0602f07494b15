"""The captions among which the judge must find the true one."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from dreamfields_core.captions import normalize
from dreamfields_core.teaching.language import describe
from dreamfields_core.teaching.pools import hard_pool, meaning, random_pool
from storage.artifacts import ArtifactRef, put_artifact
from storage.contract import Store
from storage.digests import canonical_json
from tasks.caption_sets import understood

SEED = 5
"""The pools are the same for everyone."""

HARD = 31
"""Captions of the hard pool, the true one included, as many as the models' cards count; every kind but a few stands in it once."""


def caption_pools(caption: str, size: int, among: Sequence[str] = ()) -> dict[str, list[str]]:
    """Names and captions of the pools, the true caption first.

    random: other captions of different meaning; where the caption belongs to a set of its own, `among`, the others of the set, written
    as the paper does it. hard: the same with only the kinds of things changed, where the caption is one that the embedded models'
    language can vary.
    """
    if among:
        written = dict.fromkeys([normalize(caption), *map(normalize, among)])
        return {"random": list(written)}
    true = understood(caption)
    others = [other for other in random_pool(np.random.default_rng(SEED), size) if true is None or meaning(other) != meaning(true)]
    pools = {"random": [caption, *map(describe, others[: size - 1])]}
    if true is not None:
        pools["hard"] = [caption, *map(describe, hard_pool(true, min(HARD, size) - 1, seed=SEED))]
    return pools


def keep_pool(store: Store, among: Sequence[str]) -> ArtifactRef | None:
    """The set of captions as a file for the score, None where the usual pools serve."""
    return put_artifact(store, "captions.json", canonical_json(list(among)), "application/json") if among else None


def read_pool(data: bytes) -> list[str]:
    """The inverse, for the bytes of the file."""
    return list(map(str, json.loads(data)))

"""The captions among which the judge must find the true one."""

from __future__ import annotations

import numpy as np

from dreamfields_core.teaching.language import Description, describe, parse
from dreamfields_core.teaching.pools import hard_pool, meaning, random_pool

SEED = 5
"""The pools are the same for everyone."""


def caption_pools(caption: str, size: int) -> dict[str, list[str]]:
    """random: other captions of different meaning, and the true one. hard: the same with only the kinds of things changed, where
    the caption is one that the embedded models' language can vary."""
    true = _understood(caption)
    others = [other for other in random_pool(np.random.default_rng(SEED), size) if true is None or meaning(other) != meaning(true)]
    pools = {"random": [caption, *map(describe, others[: size - 1])]}
    if true is not None:
        pools["hard"] = [caption, *map(describe, hard_pool(true, size - 1, seed=SEED))]
    return pools


def _understood(caption: str) -> Description | None:
    try:
        return parse(caption)
    except ValueError:
        return None

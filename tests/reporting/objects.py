"""Objects as a sweep leaves them, with the scores that a test wants."""

from __future__ import annotations

from typing import Any

from dreamfields_core.reporting.contract import Entry

JUDGE = "embedded-judge"


def retrieval(rank: int, *, similarity: float = 0.25, pool: int = 153) -> dict[str, Any]:
    """What the judge says of one object, as result.json holds it."""
    return {
        "similarity": similarity,
        "rank": rank,
        "correct": rank == 1,
        "similarities": [similarity],
        "ranks": [rank],
        "pool": pool,
    }


def result(rank: int, *, mesh: int | None = None, hard: int = 2, judge: str = JUDGE, same_model: bool = False) -> dict[str, Any]:
    """A dream's result with the ranks of its field, of its mesh (the same unless said), and in the hard pool."""
    pools = {
        source: {"random": retrieval(place), "hard": retrieval(hard, similarity=0.2, pool=36)}
        for source, place in (("field", rank), ("mesh", mesh or rank))
    }
    return {"scores": {judge: {**pools["field"]["random"], **pools}}, "encoders": {"same_model": same_model}, "seconds": {"optimize": 60.5}}


def entry(variant: str, caption: str, seed: int, rank: int | None, **options: Any) -> Entry:
    """An object by its rank; None is one that failed."""
    if rank is None:
        return Entry(variant, caption, seed, error="expected finite steps, but step 7 is not finite: lower optim.rate")
    return Entry(variant, caption, seed, result(rank, **options))

"""From objects to the numbers of the table: R-Precision by variant, judge, pool and what the pictures were taken of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from dreamfields_core.judging.tables import Estimate, ObjectKey, clustered_mean, paired_difference
from dreamfields_core.reporting.contract import POOLS, SOURCES, Change, Entry, Pool, Report, Row, Source


def retrieval(entry: Entry, judge: str, pool: Pool, source: Source) -> dict[str, Any] | None:
    """What the judge said of the object (judging/retrieval.py), None where it was not asked."""
    said: Any = entry.result or {}
    for name in ("scores", judge, source, pool):
        said = said.get(name) or {}
    return said or None


def outcomes(entries: Iterable[Entry], judge: str, pool: Pool, source: Source) -> dict[ObjectKey, float]:
    """1 where the judge picked the caption, 0 where not, by caption and seed; of objects alone, failures are not counted as wrong."""
    said = {(entry.caption, entry.seed): retrieval(entry, judge, pool, source) for entry in entries}
    return {key: float(found["correct"]) for key, found in said.items() if found}


def precision(entries: Iterable[Entry], judge: str, pool: Pool, source: Source) -> Estimate | None:
    """R-Precision (paper section 5.1) with its standard error; None where the judge saw nothing."""
    values = outcomes(entries, judge, pool, source)
    return clustered_mean(list(values.values()), [caption for caption, _ in values]) if values else None


def similarity(entries: Iterable[Entry], judge: str, source: Source) -> Estimate | None:
    """Mean cosine of the first view with the true caption."""
    said = [(entry.caption, retrieval(entry, judge, "random", source)) for entry in entries]
    values = [(float(found["similarity"]), caption) for caption, found in said if found]
    return clustered_mean([value for value, _ in values], [caption for _, caption in values]) if values else None


def improvement(entries: Iterable[Entry], base: Iterable[Entry], judge: str, pool: Pool, source: Source) -> Estimate | None:
    """R-Precision minus that of `base`, over the captions and seeds that both have."""
    return paired_difference(outcomes(entries, judge, pool, source), outcomes(base, judge, pool, source))


def all_rows(report: Report) -> tuple[Row, ...]:
    """The rows that the report names, then a row for each variant that has none."""
    named = {row.name for row in report.rows}
    return report.rows + tuple(Row(name) for name in dict.fromkeys(entry.variant for entry in report.entries) if name not in named)


def by_variant(entries: Iterable[Entry]) -> dict[str, list[Entry]]:
    """The objects of each variant."""
    groups: dict[str, list[Entry]] = {}
    for entry in entries:
        groups.setdefault(entry.variant, []).append(entry)
    return groups


def compare(before: Iterable[Entry], now: Iterable[Entry], judges: Sequence[str]) -> tuple[Change, ...]:
    """How R-Precision changed between two evaluations, over the objects that both have; falls beyond the standard error are flagged.

    An error that is unknown, since there is but one caption, flags any fall.
    """
    earlier, later = by_variant(before), by_variant(now)
    changes = []
    for variant in later:
        for judge in judges:
            for pool in POOLS:
                for source in SOURCES:
                    old, new = (outcomes(group.get(variant, ()), judge, pool, source) for group in (earlier, later))
                    changes += _change(variant, judge, pool, source, old, new)
    return tuple(changes)


def _change(variant: str, judge: str, pool: Pool, source: Source, old: dict[ObjectKey, float], new: dict[ObjectKey, float]) -> list[Change]:
    moved = paired_difference(new, old)
    if moved is None:
        return []
    shared = old.keys() & new.keys()
    mean_before, mean_now = (sum(values[key] for key in shared) / len(shared) for values in (old, new))
    fell = moved.mean < 0 and not -moved.mean <= moved.error
    return [Change(variant, judge, pool, source, mean_before, mean_now, moved.error, moved.objects, fell)]

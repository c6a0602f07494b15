"""From objects to the numbers of the table, against sums by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from dreamfields_core.reporting.contract import Entry, Report, Row
from dreamfields_core.reporting.statistics import all_rows, compare, improvement, outcomes, precision, similarity
from tests.reporting.objects import JUDGE, entry

BASE = [entry("none", "a", 0, 1), entry("none", "a", 1, 5), entry("none", "b", 0, 9), entry("none", "b", 1, None)]
OURS = [entry("ours", "a", 0, 1), entry("ours", "a", 1, 1, mesh=7), entry("ours", "b", 0, 2), entry("ours", "b", 1, 1)]


def test_precision_counts_objects_that_are_there() -> None:
    found = precision(BASE, JUDGE, "random", "field")
    assert found is not None and found.mean == pytest.approx(1 / 3) and (found.objects, found.captions) == (3, 2)
    # Residuals of the captions: (2/3 - 1/3) and -1/3; two captions.
    assert found.error == pytest.approx(math.sqrt(2 * 2 * (1 / 3) ** 2) / 3)


def test_field_and_mesh_and_pools_are_told_apart() -> None:
    assert outcomes(OURS, JUDGE, "random", "field") == {("a", 0): 1, ("a", 1): 1, ("b", 0): 0, ("b", 1): 1}
    assert outcomes(OURS, JUDGE, "random", "mesh") == {("a", 0): 1, ("a", 1): 0, ("b", 0): 0, ("b", 1): 1}
    assert sum(outcomes(OURS, JUDGE, "hard", "field").values()) == 0


def test_improvement_pairs_what_both_have() -> None:
    found = improvement(OURS, BASE, JUDGE, "random", "field")
    assert found is not None and found.objects == 3 and found.mean == pytest.approx(1 / 3)


def test_a_judge_that_was_not_asked_says_nothing() -> None:
    assert precision(OURS, "another", "random", "field") is None
    assert similarity(OURS, "another", "field") is None
    assert improvement(OURS, BASE, "another", "random", "field") is None
    assert precision([Entry("x", "a", 0, {"scores": {JUDGE: {"field": {}}}})], JUDGE, "random", "mesh") is None


def test_similarity_is_of_the_random_pool() -> None:
    found = similarity(OURS, JUDGE, "mesh")
    assert found is not None and found.mean == pytest.approx(0.25) and found.objects == 4


def test_variants_without_a_row_follow_those_with_one() -> None:
    report = Report("", (entry("new", "a", 0, 1), *OURS, *BASE), rows=(Row("oracle"), Row("ours")))
    assert [row.name for row in all_rows(report)] == ["oracle", "ours", "new", "none"]


def objects(*ranks: int, variant: str = "ours") -> list[Entry]:
    return [entry(variant, f"caption {i}", 0, rank) for i, rank in enumerate(ranks)]


def changes(before: list[Entry], now: list[Entry]) -> dict:
    return {(change.variant, change.pool, change.source): change for change in compare(before, now, (JUDGE,))}


def test_a_fall_beyond_its_error_is_flagged() -> None:
    fallen = changes(objects(1, 1, 1, 1), objects(1, 2, 2, 2))["ours", "random", "field"]
    assert (fallen.before, fallen.now, fallen.objects) == (1.0, 0.25, 4)
    assert fallen.fell and fallen.error == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("before", "now"),
    [
        ((1, 1, 1, 2), (2, 1, 1, 2)),  # one of four: a fall by just its error
        ((2, 2, 2, 2), (1, 1, 1, 2)),  # a rise
        ((1, 2, 1, 2), (1, 2, 1, 2)),  # nothing
        ((1, 2), (2, 1)),  # one each way
    ],
)
def test_other_changes_are_not_flagged(before: tuple[int, ...], now: tuple[int, ...]) -> None:
    assert not any(change.fell for change in changes(objects(*before), objects(*now)).values())


def test_a_whole_variant_that_falls_is_flagged_though_its_error_is_zero() -> None:
    assert changes(objects(1, 1), objects(2, 2))["ours", "random", "mesh"].fell


def test_a_fall_of_a_single_caption_is_flagged() -> None:
    assert changes(objects(1), objects(2))["ours", "random", "field"].fell


def test_only_what_both_nights_have_is_compared() -> None:
    now = [*objects(1, 1), *objects(2, variant="new")]
    found = changes(objects(1, 2, 2), now)
    assert {variant for variant, _, _ in found} == {"ours"}
    assert found["ours", "random", "field"].objects == 2
    assert changes(objects(1), [replace(now[0], result=None)]) == {}

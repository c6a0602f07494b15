"""Means of objects that share captions: against loops over all pairs, against known cases, and against what resampling finds."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.judging.tables import clustered_mean, paired_difference

OBJECTS = st.lists(st.tuples(st.floats(-1e3, 1e3), st.sampled_from("abcde")), min_size=1, max_size=12)


def slow_error(values: list[float], captions: list[str]) -> float:
    """Covariances of all pairs of objects that share a caption, one by one."""
    n, clusters = len(values), len(set(captions))
    mean = sum(values) / n
    total = 0.0
    for value, caption in zip(values, captions):
        for other, other_caption in zip(values, captions):
            if caption == other_caption:
                total += (value - mean) * (other - mean)
    return math.sqrt(max(total, 0.0) * clusters / (clusters - 1)) / n if clusters > 1 else math.nan


@settings(max_examples=100)
@given(objects=OBJECTS)
def test_the_clustered_mean_against_a_loop_over_pairs(objects: list[tuple[float, str]]) -> None:
    values, captions = [value for value, _ in objects], [caption for _, caption in objects]
    found = clustered_mean(values, captions)
    assert found.mean == pytest.approx(np.mean(values), abs=1e-9)
    assert found.error == pytest.approx(slow_error(values, captions), abs=1e-5, nan_ok=True)
    assert (found.objects, found.captions) == (len(values), len(set(captions)))


@settings(max_examples=50)
@given(values=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=20))
def test_with_one_seed_a_caption_it_is_the_plain_standard_error(values: list[float]) -> None:
    assert clustered_mean(values, [str(i) for i in range(len(values))]).error == pytest.approx(float(scipy.stats.sem(values)), abs=1e-9)


def test_the_papers_own_errors_come_out_of_its_counts() -> None:
    """Table 1: 96 of 306 objects, taken as independent, are 31.37 +- 2.6569 percent; table 2: 54 of 153 are 35.2941 +- 3.8762."""
    for right, objects, mean, error in ((96, 306, 31.3725, 2.6569), (54, 153, 35.2941, 3.8762)):
        found = clustered_mean([1.0] * right + [0.0] * (objects - right), [str(i) for i in range(objects)])
        assert (round(100 * found.mean, 4), round(100 * found.error, 4)) == (mean, error)


def test_the_same_object_twice_tells_no_more_than_once() -> None:
    values, captions = [1.0, 0.0, 1.0, 1.0], list("abcd")
    assert clustered_mean(values * 2, captions * 2).error == pytest.approx(clustered_mean(values, captions).error)


def test_the_error_agrees_with_drawing_new_captions() -> None:
    """Captions differ in difficulty: over fresh draws of 40 captions with two seeds each, the mean varies as the error says."""
    rng = np.random.default_rng(0)
    captions = [str(i) for i in range(40) for _ in range(2)]
    difficulty = rng.beta(0.5, 0.5, size=(2000, 40)).repeat(2, axis=1)
    draws = (rng.random(difficulty.shape) < difficulty).astype(float)
    stated = np.mean([clustered_mean(list(draw), captions).error for draw in draws[:300]])
    seen = draws.mean(axis=1).std()
    assert stated == pytest.approx(seen, rel=0.05)
    as_if_independent = np.mean(scipy.stats.sem(draws[:300], axis=1))
    assert as_if_independent < 0.87 * seen


def test_a_single_caption_leaves_the_error_unknown() -> None:
    assert math.isnan(clustered_mean([1.0, 0.0], ["a", "a"]).error)


@pytest.mark.parametrize(("values", "captions"), [([], []), ([1.0], []), ([], ["a"])])
def test_nothing_to_average_is_refused(values: list, captions: list) -> None:
    with pytest.raises(ValueError, match="expected at least one value and a caption for each"):
        clustered_mean(values, captions)


def test_the_difference_is_over_shared_objects_and_pairs_them() -> None:
    these = {("a", 0): 1.0, ("a", 1): 1.0, ("b", 0): 0.0, ("c", 0): 1.0}
    those = {("a", 0): 0.0, ("a", 1): 1.0, ("b", 0): 0.0, ("d", 0): 0.0}
    found = paired_difference(these, those)
    assert found is not None and found.objects == 3 and found.captions == 2
    assert found.mean == pytest.approx(1 / 3)
    assert found.error == pytest.approx(slow_error([1.0, 0.0, 0.0], ["a", "a", "b"]))
    back = paired_difference(those, these)
    assert back is not None and back.mean == -found.mean and back.error == found.error


def test_what_all_captions_share_cancels_in_the_difference() -> None:
    hard, easy = {(str(i), 0): float(i % 2) for i in range(10)}, {(str(i), 0): float(i % 2) + 0.25 for i in range(10)}
    found = paired_difference(easy, hard)
    assert found is not None and found.mean == pytest.approx(0.25) and found.error == pytest.approx(0.0, abs=1e-12)


def test_nothing_shared_is_no_difference() -> None:
    assert paired_difference({("a", 0): 1.0}, {("a", 1): 1.0}) is None

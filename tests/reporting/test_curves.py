"""Learning curves: thinned and averaged against loops, drawn within their frame."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.reporting.contract import Entry
from dreamfields_core.reporting.curves import Band, mean_curve, single, thin
from dreamfields_core.reporting.plots import extent, plot, round_values

NAN = math.nan


def test_short_histories_stay_as_they_are() -> None:
    history = {"step": (1, 2, 3), "loss": (0.5, 0.25, NAN)}
    assert thin(history, 3) is history


@settings(max_examples=30)
@given(length=st.integers(5, 200), points=st.integers(2, 5))
def test_thinned_points_are_means_of_the_steps_between(length: int, points: int) -> None:
    values = np.random.default_rng(length).normal(size=length)
    thinned = thin({"step": np.arange(1, length + 1).tolist(), "loss": values.tolist()}, points)
    ends = [int(step) for step in thinned["step"]]
    assert len(ends) == min(points, length) and ends[-1] == length
    if length > points:
        expected = [sum(values[begin:end]) / (end - begin) for begin, end in zip([0, *ends], ends)]
        np.testing.assert_allclose(thinned["loss"], expected)


def test_what_was_not_measured_counts_for_nothing() -> None:
    thinned = thin({"step": [1, 2, 3, 4], "correct": [NAN, 1.0, NAN, NAN]}, 2)
    assert thinned["step"] == (2.0, 4.0) and thinned["correct"][0] == 1.0 and math.isnan(thinned["correct"][1])
    band = single(thinned, "correct")
    assert band is not None and band.steps == (2.0,) and band.means == (1.0,)
    assert single(thinned, "loss") is None


def test_in_the_mean_a_dream_that_ended_earlier_stays_as_it_was_left() -> None:
    entries = [
        Entry("ours", "a", 0, history={"step": (1, 2), "loss": (1.0, 2.0)}),
        Entry("ours", "b", 0, history={"step": (1, 2, 3), "loss": (3.0, NAN, 5.0)}),
        Entry("ours", "c", 0),
    ]
    assert mean_curve(entries, "loss") == Band((1.0, 3.0), (2.0, 3.5), (1.0, 1.5))
    assert mean_curve(entries, "transmittance") is None


@settings(max_examples=50)
@given(
    means=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=8),
    error=st.floats(0, 1e3),
)
def test_curves_stay_within_their_frame(means: list[float], error: float) -> None:
    band = Band(tuple(range(1, len(means) + 1)), tuple(means), (error,) * len(means))
    drawn = plot(band, "Loss", values=extent([band]), width=200, height=100)
    pairs = [tuple(map(float, pair.split(","))) for points in re.findall(r'points="([^"]*)"', drawn) for pair in points.split()]
    assert len(pairs) >= len(means)
    assert all(0 <= x <= 200 and 0 <= y <= 100 for x, y in pairs)
    assert "nan" not in drawn and "inf" not in drawn


@settings(max_examples=100)
@given(low=st.floats(-1e6, 1e6), width=st.floats(1e-3, 1e6))
def test_ticks_are_few_round_and_inside(low: float, width: float) -> None:
    ticks = round_values(low, low + width)
    assert 1 <= len(ticks) <= 6
    slack = 1e-6 * width
    assert all(low - slack <= tick <= low + width + slack for tick in ticks)


@pytest.mark.parametrize(
    ("values", "ticks"), [((0.0, 1.0), [0.0, 0.5, 1.0]), ((-1.16, -0.4), [-1.0, -0.5]), ((0.0, 30.0), [0, 10, 20, 30])]
)
def test_ticks(values: tuple[float, float], ticks: list[float]) -> None:
    assert round_values(*values) == pytest.approx(ticks)

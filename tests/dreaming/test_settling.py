"""A dream ends early when it has nothing more to gain, and never before its schedules have run their course."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.config import LossConfig, OptimConfig
from dreamfields_core.dreaming.settling import has_settled

OPTIM = OptimConfig(steps=1000, warmup_steps=10, settle_window=20, settle_gain=0.01)
LOSS = LossConfig(anneal_steps=30)


def first_settled(similarities: np.ndarray, optim: OptimConfig = OPTIM) -> int | None:
    """The step at which a dream of these similarities ends."""
    return next((step for step in range(len(similarities) + 1) if has_settled(similarities[:step].tolist(), optim, LOSS)), None)


def rising(steps: int, *, scale: float = 50.0) -> np.ndarray:
    """Towards 1, noisy, as float32 metrics are."""
    noise = 0.02 * np.random.default_rng(0).normal(size=steps)
    return np.float32(1 - np.exp(-np.arange(steps) / scale) + noise)


def test_it_ends_at_the_first_window_that_gains_too_little() -> None:
    course = rising(1000)
    ends = first_settled(course)
    assert ends is not None and ends % 20 == 0
    means = course.astype(np.float64).reshape(-1, 20).mean(axis=1)
    gains = np.diff(means)
    # Window number k gains gains[k - 1]; the first two windows behind the annealing of 30 steps end at step 80.
    slow = [number + 2 for number, gain in enumerate(gains) if gain < 0.01 and 20 * (number + 2) >= 30 + 40]
    assert ends == 20 * slow[0]


@pytest.mark.parametrize("warmup, anneal, least", [(0, 1, 60), (500, 1, 540), (0, 333, 380)])
def test_it_waits_for_warm_up_and_annealing(warmup: int, anneal: int, least: int) -> None:
    flat = [0.5] * 1000
    optim, loss = OPTIM.model_copy(update={"warmup_steps": warmup}), LossConfig(anneal_steps=anneal)
    ends = next(step for step in range(1000) if has_settled(flat[:step], optim, loss))
    assert ends == least


def test_without_a_window_it_goes_on() -> None:
    assert first_settled(np.full(500, 0.5), OPTIM.model_copy(update={"settle_window": None})) is None
    assert OptimConfig().settle_window is None


def test_what_rises_steadily_or_is_not_a_number_goes_on() -> None:
    assert first_settled(np.linspace(0, 1, 1000)) is None
    assert first_settled(np.full(1000, np.nan)) is None
    falling_apart = np.where(np.arange(1000) % 20 == 3, np.nan, 0.5)
    assert first_settled(falling_apart) is None


def test_a_falling_similarity_is_settled() -> None:
    assert first_settled(np.linspace(1, 0, 1000)) == 80

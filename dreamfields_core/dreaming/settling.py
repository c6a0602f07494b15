"""When a dream has nothing more to gain: its similarity to the caption, averaged over a window of steps, no longer rises."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dreamfields_core.config import LossConfig, OptimConfig


def is_looked_at(step: int, optim: OptimConfig) -> bool:
    """Whether it is decided after so many steps if the dream goes on: at the end of each window."""
    return optim.settle_window is not None and step > 0 and step % optim.settle_window == 0


def has_settled(similarities: Sequence[float], optim: OptimConfig, loss: LossConfig) -> bool:
    """Whether the mean similarity of the last window is less than `settle_gain` above that of the window before.

    Both windows lie behind the warm-up of the rate and the annealing of the opacity, which move the similarity by themselves.
    It is a function of the history alone, which is in every checkpoint: a dream that was stopped and went on ends at the same step.

    Args:
      similarities: one a step taken; what is not a number is never settled.
    """
    step = len(similarities)
    if not is_looked_at(step, optim):
        return False
    window = optim.settle_window or 1
    if step < max(optim.warmup_steps, loss.anneal_steps) + 2 * window:
        return False
    # Float64 of numbers that were float32 once: the same after they have been to a checkpoint and back.
    last, before = (np.mean(np.asarray(part, np.float64)) for part in (similarities[-window:], similarities[-2 * window : -window]))
    return bool(last - before < optim.settle_gain)

"""Learning curves: one object's, thinned, and the mean of a variant's with its standard error (paper appendix F)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dreamfields_core.judging.tables import clustered_mean
from dreamfields_core.reporting.contract import Entry, History

POINTS = 60
"""Of a curve; more than a plot of its size can show would only make the page heavy."""
QUANTITIES = {"loss": "Loss", "similarity": "Similarity to the guide", "transmittance": "Transmittance", "correct": "R-Precision"}
"""What is drawn, in this order. A guide that still improves while R-Precision falls is over-fitting."""


@dataclass(frozen=True)
class Band:
    """A mean curve: steps, means and standard errors, each [N]; an error is 0 where it is unknown."""

    steps: tuple[float, ...]
    means: tuple[float, ...]
    errors: tuple[float, ...]


def thin(history: History, points: int = POINTS) -> History:
    """At most so many points, each the mean of the steps since the one before; NaN counts for nothing, and stays if there is no other."""
    length = len(history["step"])
    if length <= points:
        return history
    ends = np.linspace(0, length, points + 1).round().astype(int)
    thinned = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean of nothing but NaN is NaN, as it should be
        for name, values in history.items():
            column = np.asarray(values, np.float64)
            parts = [column[begin:end] for begin, end in pairwise(ends)]
            thinned[name] = tuple(float(part[-1] if name == "step" else np.nanmean(part)) for part in parts)
    return thinned


def single(history: History, quantity: str) -> Band | None:
    """One object's curve without a band; None where it was not recorded."""
    steps, values = known(history, quantity)
    return Band(steps, values, (0.0,) * len(steps)) if steps else None


def mean_curve(entries: Iterable[Entry], quantity: str) -> Band | None:
    """The mean over objects with the standard error clustered by caption, at the steps of the longest curve; None where there is no curve.

    A dream that ended earlier counts on with its last value: it stays as it was left.
    """
    curves = [(entry.caption, *known(entry.history, quantity)) for entry in entries if entry.history]
    curves = [curve for curve in curves if curve[1]]
    if not curves:
        return None
    captions = [caption for caption, _, _ in curves]
    steps = max((steps for _, steps, _ in curves), key=lambda steps: (steps[-1], len(steps)))
    columns = np.stack([np.interp(steps, at, values) for _, at, values in curves], axis=1)
    found = [clustered_mean(column.tolist(), captions) for column in columns]
    return Band(steps, tuple(one.mean for one in found), tuple(0.0 if math.isnan(one.error) else one.error for one in found))


def known(history: History, quantity: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Steps and values where the quantity is a finite number."""
    pairs = [(float(step), float(value)) for step, value in zip(history["step"], history.get(quantity, ())) if math.isfinite(value)]
    return tuple(step for step, _ in pairs), tuple(value for _, value in pairs)

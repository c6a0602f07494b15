"""Means with standard errors, as the tables of a sweep state them, when several objects share a caption.

Symbols: n objects, C captions, x_ci the value of object i of caption c (for R-Precision 1 or 0), m their mean.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

ObjectKey = tuple[str, int]
"""Caption and seed: what pairs an object of one variant with one of another."""


@dataclass(frozen=True)
class Estimate:
    """mean, its standard error (NaN where a single caption leaves it unknown), and over how many objects and captions."""

    mean: float
    error: float
    objects: int
    captions: int


def clustered_mean(values: Sequence[float], captions: Sequence[str]) -> Estimate:
    """Mean over all objects, with a standard error that lets objects of one caption be alike.

    error^2 = C / (C - 1) * sum_c (sum_i (x_ci - m))^2 / n^2: the sandwich of Liang and Zeger (Biometrika 73, 1986) for a mean, with
    the correction for few clusters of Cameron and Miller (Journal of Human Resources 50, 2015, section VI). Seeds of one caption succeed
    or fail together, so to count them as independent, as the paper does with its two seeds, states too small an error. With one seed a
    caption both are the same, the standard deviation over the root of n.

    Raises:
      ValueError: no value, or not one caption a value.
    """
    if not values or len(values) != len(captions):
        raise ValueError(f"expected at least one value and a caption for each, got {len(values)} values and {len(captions)} captions")
    n, mean = len(values), math.fsum(values) / len(values)
    residuals: defaultdict[str, list[float]] = defaultdict(list)
    for value, caption in zip(values, captions):
        residuals[caption].append(value - mean)
    clusters = len(residuals)
    if clusters == 1:
        return Estimate(mean, math.nan, n, 1)
    spread = math.fsum(math.fsum(parts) ** 2 for parts in residuals.values())
    return Estimate(mean, math.sqrt(clusters / (clusters - 1) * spread) / n, n, clusters)


def paired_difference(these: Mapping[ObjectKey, float], those: Mapping[ObjectKey, float]) -> Estimate | None:
    """Mean of `these` minus `those` over the objects that both have: what captions find easy or hard cancels in each pair.

    The error is that of the differences' clustered mean. None where they share no object.
    """
    shared = sorted(these.keys() & those.keys())
    if not shared:
        return None
    return clustered_mean([these[key] - those[key] for key in shared], [caption for caption, _ in shared])

"""Distances against closed forms in float64, and every kind as something that is there, and whole."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.teaching import distances, words
from dreamfields_core.teaching.solids import KINDS

POINTS = np.random.default_rng(0).uniform(-2, 2, (3, 4000))


def test_a_sphere_is_its_closed_form() -> None:
    np.testing.assert_allclose(distances.ellipsoid(0.7, 0.7, 0.7)(*POINTS), np.linalg.norm(POINTS, axis=0) - 0.7, atol=1e-12)


def test_a_box_is_its_closed_form() -> None:
    half = np.array([0.5, 0.8, 0.3])[:, None]
    nearest = np.clip(POINTS, -half, half)
    outside = np.linalg.norm(POINTS - nearest, axis=0)
    inside = (np.abs(POINTS) - half).max(0)
    np.testing.assert_allclose(distances.box(0.5, 0.8, 0.3)(*POINTS), np.where(inside < 0, inside, outside), atol=1e-12)


def test_a_torus_is_the_distance_to_its_ring() -> None:
    angles = np.linspace(0, 2 * np.pi, 3000)
    ring = np.stack([0.7 * np.cos(angles), 0.7 * np.sin(angles), 0 * angles])
    few = POINTS[:, :100]
    brute = np.linalg.norm(few[:, :, None] - ring[:, None, :], axis=0).min(1) - 0.2
    np.testing.assert_allclose(distances.torus(0.7, 0.2)(*few), brute, atol=1e-3)


@pytest.mark.parametrize("axis", "xyz")
def test_turning_there_and_back_changes_nothing(axis: str) -> None:
    solid = distances.box(0.2, 0.5, 0.9)
    back = distances.turned(distances.turned(solid, axis, 0.7), axis, -0.7)
    np.testing.assert_allclose(back(*POINTS), solid(*POINTS), atol=1e-12)


@pytest.mark.parametrize("kind", words.KINDS)
def test_no_kind_overstates_a_distance(kind: str) -> None:
    """Sphere tracing is safe where no step is longer than the way to the surface: slopes are at most 1; those of flat ellipsoids are
    bounds of first order and somewhat steeper inside."""
    points = POINTS[:, :1500]
    step = np.random.default_rng(1).normal(size=points.shape)
    step *= 1e-3 / np.linalg.norm(step, axis=0)
    for part in KINDS[kind](np.random.default_rng(2)):
        slope = np.abs(part.distance(*(points + step)) - part.distance(*points)) / 1e-3
        assert np.quantile(slope, 0.99) < 1.8


@pytest.mark.parametrize("kind", words.KINDS)
def test_every_kind_is_there_and_within_reach(kind: str) -> None:
    for seed in range(3):
        inside = np.minimum.reduce([part.distance(*POINTS) for part in KINDS[kind](np.random.default_rng(seed))]) < 0
        assert 0.001 < inside.mean() < 0.2
        assert np.linalg.norm(POINTS[:, inside], axis=0).max() < 1.5

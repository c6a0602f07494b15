"""Two passes see what one fine pass sees, for a part of the evaluations."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import SkipConfig
from dreamfields_core.rendering.occupancy import Occupancy, refresh, unknown_occupancy
from dreamfields_core.rendering.refining import middles, render_refined, with_footprint, worth_refining
from dreamfields_core.rendering.render import render_rays
from dreamfields_core.rendering.sampling import gaussians_at, place_samples
from dreamfields_core.types import Rays, Rendering
from tests import reference
from tests.rendering.solids import ball, parallel_rays

WIDTH = 0.004
SOFT = ball(radius=0.5, softness=WIDTH)
ORIGIN = jnp.zeros(3)
DENSITY = 40.0


@pytest.fixture(scope="module")
def occupancy() -> Occupancy:
    """What is remembered of the soft ball."""
    ask = jax.jit(lambda key, before: refresh(key, before, SOFT, {"density": DENSITY}, ORIGIN, bound=1.0, decay=0.9))
    remembered = unknown_occupancy(16)
    for seed in range(6):
        remembered = ask(jax.random.key(seed), remembered)
    return remembered


@functools.cache
def renderer(samples: int, skip: SkipConfig) -> Callable:
    """(rays, occupancy) -> Rendering, number of samples asked for."""

    def render(rays: Rays, occupancy: Occupancy) -> tuple[Rendering, jax.Array]:
        return render_refined(SOFT, {"density": DENSITY}, rays, ORIGIN, occupancy, samples=samples, bound=1.0, skip=skip, footprint=0.01)

    return jax.jit(render)


def soft_ball_transmittance(starts: np.ndarray, toward: np.ndarray, *, steps: int = 12000) -> np.ndarray:
    """[R], float64, by the midpoint rule between distances 2 and 4, where the cube about 0 lies."""
    middles = 2.0 + (np.arange(steps) + 0.5) * 2.0 / steps
    depth = np.zeros(len(starts))
    for part in np.array_split(middles, 50):
        away = np.linalg.norm(starts[:, None] + part[None, :, None] * toward[:, None], axis=-1)
        depth += DENSITY * reference.sigmoid((0.5 - away) / WIDTH).sum(axis=1) * 2.0 / steps
    return np.exp(-depth)


def test_places_and_footprints() -> None:
    placed = place_samples(None, parallel_rays(5), ORIGIN, bound=1.0, count=24)
    said_anew = with_footprint(placed, jnp.float32(0.05))
    np.testing.assert_allclose(said_anew.distances(), placed.distances(), atol=1e-5)
    index = jnp.arange(placed.length.size)
    # Rays are nearly parallel here, so the variance along a ray is footprint^2 / 12.
    np.testing.assert_allclose(gaussians_at(said_anew, index).along, 0.05**2 / 12, rtol=1e-3)
    np.testing.assert_allclose(gaussians_at(placed, index).along, float(placed.step) ** 2 / 12, rtol=3e-3)


@pytest.mark.parametrize("finer", [1, 2, 3, 8])
def test_middles_stand_for_their_pieces(finer: int) -> None:
    fine = place_samples(None, parallel_rays(5), ORIGIN, bound=1.0, count=24)
    coarse = middles(fine, finer)
    length, distance = (np.asarray(value, np.float64).reshape(25, -1, finer) for value in (fine.length, fine.distances()))
    np.testing.assert_allclose(coarse.length, length.sum(axis=-1), atol=1e-6)
    mean = (length * distance).sum(axis=-1) / np.maximum(length.sum(axis=-1), 1e-9)
    real = np.asarray(coarse.length) > 0
    np.testing.assert_allclose(np.asarray(coarse.distances())[real], mean[real], atol=1e-5)


def test_what_is_worth_it_against_a_loop() -> None:
    depths = np.random.default_rng(0).exponential(size=(7, 12)) ** 4 * 0.05
    found = np.asarray(worth_refining(jnp.asarray(depths, jnp.float32), threshold=0.02))
    for ray, step in np.ndindex(7, 12):
        beside = [depths[ray, other] for other in (step - 1, step, step + 1) if 0 <= other < 12]
        reaching = np.exp(-depths[ray, : max(0, step - 1)].sum())
        weight = reaching * (1 - np.exp(-max(beside)))
        assert found[ray, step] == (weight > 0.02) or abs(weight - 0.02) < 1e-5
    assert 0.1 < found.mean() < 0.9


def test_in_one_pass_it_is_the_renderer(occupancy: Occupancy) -> None:
    rays, skip = parallel_rays(12), SkipConfig(chunk=1024)
    ours, asked = render_refined(SOFT, {"density": DENSITY}, rays, ORIGIN, occupancy, samples=48, bound=1.0, skip=skip)
    plain, tally = render_rays(None, SOFT, {"density": DENSITY}, rays, ORIGIN, occupancy, samples=48, bound=1.0, skip=skip)
    # The same places, and the same operations on them.
    for name in ("color", "transmittance", "depth"):
        np.testing.assert_allclose(getattr(ours, name), getattr(plain, name), atol=1e-6)
    assert int(asked) == int(tally.evaluated)


def test_two_passes_are_as_close_to_the_truth_as_one_fine_pass(occupancy: Occupancy) -> None:
    rays = parallel_rays(14)
    truth = soft_ball_transmittance(np.asarray(rays.origins, np.float64), np.asarray(rays.directions, np.float64))

    def error(samples: int, skip: SkipConfig) -> tuple[float, int]:
        seen, asked = renderer(samples, skip)(rays, occupancy)
        return float(np.sqrt(np.mean((np.asarray(seen.transmittance, np.float64) - truth) ** 2))), int(asked)

    dense_error, dense_asked = error(256, SkipConfig(enabled=False))
    coarse_error, coarse_asked = error(32, SkipConfig())
    ours_error, ours_asked = error(256, SkipConfig(refine=8))
    assert ours_error < 1.5 * dense_error + 2e-4 and ours_error < 0.25 * coarse_error
    assert coarse_asked < ours_asked < 0.12 * dense_asked

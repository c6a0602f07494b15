"""Any ray through a cube of any size, filled with any density, in any number of samples: the closed form, and its derivative."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dreamfields_core.config import SkipConfig
from dreamfields_core.rendering.occupancy import Occupancy
from dreamfields_core.rendering.render import render_rays
from dreamfields_core.types import Rays
from tests import reference
from tests.stress.extremes import BOUNDS, COLOR, DISTANCES, RAW, as_rays, medium, rays_about

CELLS = 4


@functools.cache
def seen(samples: int, enabled: bool = True) -> Callable:
    """(key, raw, rays, origin, bound, memory, counted) -> (rendering, tally), d(sum of the counted T) / d(raw), d(all else) / d(raw)."""

    def run(
        key: jax.Array, raw: jax.Array, rays: Rays, origin: jax.Array, bound: jax.Array, memory: jax.Array, counted: jax.Array
    ) -> tuple:
        skip = SkipConfig(enabled=enabled, resolution=CELLS, chunk=1024, threshold=0.0)
        occupancy = Occupancy(density=memory, known=jnp.ones((), bool))

        def render(raw: jax.Array) -> tuple:
            return render_rays(key, medium(), {"raw": raw}, rays, origin, occupancy, samples=samples, bound=bound, skip=skip)

        def means(raw: jax.Array) -> tuple:
            rendering, tally = render(raw)
            light = jnp.sum(rendering.transmittance) + jnp.sum(rendering.color) + jnp.sum(rendering.depth)
            return (jnp.sum(jnp.where(counted, rendering.transmittance, 0.0)), light), (rendering, tally)

        pull, aux = jax.vjp(means, raw, has_aux=True)[1:]
        one, zero = jnp.ones(()), jnp.zeros(())
        return aux, pull((one, zero))[0], pull((zero, one))[0]

    return jax.jit(run)


def chords(rays: Rays, origin: np.ndarray, bound: float) -> tuple[np.ndarray, np.ndarray]:
    """Lengths inside the cube in float64, and by how much float32 geometry may miss them (a start's rounding, and three more)."""
    starts = np.asarray(rays.origins) - np.float32(origin)
    crossed = np.array([reference.ray_cube(s, d, np.zeros(3), bound) for s, d in zip(starts, np.asarray(rays.directions), strict=True)])
    return crossed[:, 1] - crossed[:, 0], 4e-7 * (bound + np.abs(starts).max(axis=1))


def check(raw: float, bound: float, distance: float, origin: np.ndarray, samples: int, enabled: bool = True) -> None:
    rays = as_rays(*rays_about(bound, distance))
    origin = np.float32(origin * bound)
    sigma = reference.softplus(np.float64(np.float32(raw)))
    # What the grid would remember: the truth.
    memories = jnp.full((CELLS,) * 3, sigma, jnp.float32)
    chord, off = chords(rays, origin, bound)
    decided = np.abs(chord) > off
    (rendering, tally), slope, light = seen(samples, enabled)(
        jax.random.key(samples), jnp.float32(raw), rays, jnp.asarray(origin), jnp.float32(bound), memories, jnp.asarray(decided)
    )
    exact = reference.medium_transmittance(chord, sigma)
    # Sums of `samples` float32 terms, and the chord's own error at the slope's steepest: x exp(-x) is at most 1 / e.
    loose = 3e-7 * np.sqrt(samples) + np.minimum(1.0, np.where(chord > 0, off / np.maximum(chord, off), 0.0))
    # Where hit or miss hangs on a rounding, either answer is right, and so is everything between.
    loose = np.where(decided, loose, 1.0)
    transmittance = np.asarray(rendering.transmittance, np.float64)
    assert (np.abs(transmittance - exact) <= loose + 1e-6).all(), np.abs(transmittance - exact).max()
    assert ((transmittance >= 0) & (transmittance <= 1)).all()
    np.testing.assert_allclose(rendering.color, (1 - transmittance)[:, None] * np.array(COLOR), atol=1e-6 * np.sqrt(samples))
    assert np.isfinite(np.asarray(rendering.depth)).all() and (np.asarray(rendering.depth) >= 0).all()
    assert np.isfinite(float(tally.mass)) and np.isfinite(np.asarray(tally.moment)).all()
    # dT / d raw = -chord T sigmoid(raw); sigmoid is 1 - exp(-softplus).
    steep = np.where(decided & (exact > 0), chord * exact * -np.expm1(-sigma), 0.0)
    # What lies behind an optical depth of 18 is left out (half of what is remembered is believed): x exp(-x) there is below 3e-7.
    hidden = np.where(decided & (chord * min(sigma, 1e30) > 9.0), 3e-7, 0.0)
    margin = np.sum(np.where(decided, loose, 0.0) * (steep + steep.max()) + hidden)
    assert np.isfinite(float(slope)) and np.isfinite(float(light))
    assert abs(float(slope) + steep.sum()) <= margin + 1e-5 * steep.sum() + 1e-30, (float(slope), steep.sum())


@settings(max_examples=25)
@given(raw=RAW, bound=BOUNDS, distance=st.sampled_from(DISTANCES), samples=st.sampled_from([1, 7]))
@example(raw=float("inf"), bound=1e-8, distance=1e4, samples=7)
@example(raw=float("-inf"), bound=1e4, distance=1e-8, samples=1)
@example(raw=1e30, bound=1.0, distance=4.0, samples=7)
def test_a_full_cube(raw: float, bound: float, distance: float, samples: int) -> None:
    check(raw, bound, distance, np.zeros(3), samples)


@pytest.mark.parametrize("origin", [(1.0, 0.0, 0.0), (1.0, 1.0, 1.0), (-1.0, 0.5, 1.0)])
@pytest.mark.parametrize("raw", [-30.0, 0.5, 1e30])
def test_an_origin_at_the_wall(origin: tuple, raw: float) -> None:
    """The cube has moved by its own half-side: rays that started inside it start on its faces, edges and corners."""
    for distance in DISTANCES:
        check(raw, 1.0, distance, np.array(origin), 7)


@pytest.mark.parametrize("samples", [64, pytest.param(4096, marks=pytest.mark.slow)])
@pytest.mark.parametrize("raw", [-10.0, 0.3, 40.0])
def test_many_samples(samples: int, raw: float) -> None:
    check(raw, 1.0, 4.0, np.zeros(3), samples)


@pytest.mark.parametrize("memory", [0.0, 1e30, np.inf])
def test_whatever_is_remembered_nothing_is_infinite(memory: float) -> None:
    """A memory of nothing explores; one of an infinite density ends every ray inside: both give numbers, and gradients."""
    for raw in (-np.inf, -30.0, 0.5, 1e30, np.inf):
        rays = as_rays(*rays_about(1.0, 4.0))
        memories = jnp.full((CELLS,) * 3, memory, jnp.float32)
        (rendering, tally), slope, light = seen(7)(
            jax.random.key(0), jnp.float32(raw), rays, jnp.zeros(3), jnp.float32(1.0), memories, jnp.ones(len(rays.radii), bool)
        )
        for value in (*jax.tree.leaves((rendering, tally)), slope, light):
            assert np.isfinite(np.asarray(value)).all(), (raw, value)
        assert (np.asarray(rendering.transmittance) <= 1).all()


def test_skipping_or_not_a_full_cube_is_the_same() -> None:
    for raw in (-3.0, 2.0, np.inf):
        check(raw, 1.0, 4.0, np.zeros(3), 7, enabled=False)

"""What is left out makes no difference: nothing of the object, nothing on average of the rest, nothing seen behind a wall."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import SkipConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.rendering.occupancy import (
    Occupancy,
    cell_index,
    inner_density,
    occupied_cells,
    refresh,
    refresh_some,
    unknown_occupancy,
)
from dreamfields_core.rendering.render import render_rays
from dreamfields_core.rendering.sampling import place_samples
from dreamfields_core.rendering.skipping import choose_samples
from tests import reference
from tests.rendering.solids import ball, parallel_rays

CELLS, SAMPLES, RADIUS = 16, 64, 0.5
BALL = ball(radius=RADIUS)
TWO = ball(radius=0.4, softness=0.004, centers=((-0.35, 0.0, 0.0), (0.45, 0.2, 0.0)))
ORIGIN = jnp.array([0.05, -0.1, 0.02])


@functools.cache
def asker(field: Field) -> Callable:
    """(key, occupancy, density) -> occupancy after one refresh; compiled once a resolution."""
    return jax.jit(lambda key, occupancy, density: refresh(key, occupancy, field, {"density": density}, ORIGIN, bound=1.0, decay=0.9))


def known(field: Field, density: float, *, cells: int = CELLS, refreshes: int = 8) -> Occupancy:
    """What is remembered of a field after some refreshes."""
    occupancy = unknown_occupancy(cells)
    for seed in range(refreshes):
        occupancy = asker(field)(jax.random.key(seed), occupancy, density)
    return occupancy


@functools.cache
def chooser(skip: SkipConfig) -> Callable:
    """(key, placed, occupancy) -> kept, weight."""
    return jax.jit(lambda key, placed, occupancy: choose_samples(key, placed, ORIGIN, occupancy, bound=1.0, skip=skip))


@pytest.mark.parametrize("turns", [2, 4, 8])
def test_by_turns_every_cell_is_asked_once(turns: int) -> None:
    everywhere = ball(radius=9.0)
    before = Occupancy(density=jnp.full((CELLS,) * 3, 0.5), known=jnp.ones((), bool))
    ask = jax.jit(
        lambda occupancy, turn: refresh_some(
            jax.random.key(0), occupancy, everywhere, {"density": 7.0}, ORIGIN, turn=turn, turns=turns, bound=1.0, decay=0.9
        )
    )
    times = np.zeros((CELLS,) * 3, int)
    for turn in range(turns, 2 * turns):
        after = np.asarray(ask(before, jnp.int32(turn)).density)
        asked = after != 0.5
        np.testing.assert_allclose(after[asked], 7.0, rtol=1e-5)
        assert asked.sum() == CELLS**3 // turns
        # Spread out: along every axis a cell in so many.
        for axis in range(3):
            assert (asked.sum(axis) == CELLS // turns).all()
        times += asked
    assert (times == 1).all()


def test_a_cell_asked_by_turns_forgets_as_one_asked_always() -> None:
    nowhere, nothing = ball(radius=0.0), {"density": 0.0}
    by_turns = every = Occupancy(density=jnp.full((CELLS,) * 3, 2.0), known=jnp.ones((), bool))
    for turn in range(4):
        key, number = jax.random.key(turn), jnp.int32(turn)
        by_turns = refresh_some(key, by_turns, nowhere, nothing, ORIGIN, turn=number, turns=4, bound=1.0, decay=0.9)
        every = refresh(key, every, nowhere, nothing, ORIGIN, bound=1.0, decay=0.9)
    np.testing.assert_allclose(every.density, 2.0 * 0.9**4, rtol=1e-5)
    np.testing.assert_allclose(by_turns.density, every.density, rtol=1e-5)


def test_turns_that_do_not_divide_the_cells_are_refused() -> None:
    with pytest.raises(ValueError, match="expected turns that divide the 4 cells a side, got 3"):
        refresh_some(jax.random.key(0), unknown_occupancy(4), BALL, {}, ORIGIN, turn=jnp.int32(0), turns=3, bound=1.0, decay=0.9)


def test_cells_against_a_twin() -> None:
    points = np.float32(np.random.default_rng(0).uniform(-1.5, 1.5, (200, 3)))
    origin = np.float32([0.1, -0.2, 0.3])
    index = cell_index(jnp.asarray(points), jnp.asarray(origin), bound=1.0, resolution=5)
    expected = [np.ravel_multi_index(reference.cell_of(point, origin, 1.0, 5), (5, 5, 5)) for point in points]
    np.testing.assert_array_equal(index, expected)


def test_what_is_dense_and_its_neighbours_count_as_occupied() -> None:
    density = np.zeros((5, 5, 5), np.float32)
    density[0, 2, 4] = 1.0
    filled = np.asarray(occupied_cells(Occupancy(jnp.asarray(density), jnp.array(True)), step=0.1, threshold=0.05))
    expected = np.zeros((5, 5, 5), bool)
    expected[:2, 1:4, 3:] = True
    np.testing.assert_array_equal(filled, expected)
    assert not np.any(occupied_cells(Occupancy(jnp.asarray(density), jnp.array(True)), step=0.01, threshold=0.05))


def test_before_anything_is_known_all_is_occupied() -> None:
    assert np.all(occupied_cells(unknown_occupancy(3), step=0.1, threshold=1e-3))


def test_inner_density_is_the_least_of_27() -> None:
    density = np.random.default_rng(0).uniform(1, 2, (4, 4, 4)).astype(np.float32)
    inner = np.asarray(inner_density(Occupancy(jnp.asarray(density), jnp.array(True))))
    for x, y, z in np.ndindex(4, 4, 4):
        inside = all(0 < place < 3 for place in (x, y, z))
        expected = density[x - 1 : x + 2, y - 1 : y + 2, z - 1 : z + 2].min() if inside else 0.0
        assert inner[x, y, z] == expected


def test_memory_fades_when_the_object_goes() -> None:
    before = known(BALL, 10.0)
    after = asker(BALL)(jax.random.key(9), before, 0.0)
    np.testing.assert_allclose(after.density, 0.9 * np.asarray(before.density), atol=1e-6)
    assert bool(after.known)


def test_nothing_of_the_object_is_left_out_and_empty_cells_are() -> None:
    occupancy = known(BALL, 10.0)
    placed = place_samples(jax.random.key(1), parallel_rays(24), ORIGIN, bound=1.0, count=SAMPLES)
    kept, weight = chooser(SkipConfig(terminate=0.0))(None, placed, occupancy)
    points = (
        np.asarray(placed.rays.origins)[:, None] + np.asarray(placed.distances())[..., None] * np.asarray(placed.rays.directions)[:, None]
    )
    distance, inside = np.linalg.norm(points, axis=-1), np.asarray(placed.length) > 0
    assert np.all(np.asarray(kept)[(distance < RADIUS) & inside])
    # A cell is occupied if a neighbour is: so never farther off than two cells' diagonals.
    assert not np.any(np.asarray(kept)[distance > RADIUS + 2 * 3**0.5 * 2 / CELLS])
    assert 0 < np.sum(kept) < 0.4 * np.sum(inside)
    np.testing.assert_array_equal(weight, 1.0)


def test_switched_off_everything_is_evaluated() -> None:
    occupancy = known(BALL, 10.0)
    placed = place_samples(None, parallel_rays(6), ORIGIN, bound=1.0, count=SAMPLES)
    kept, weight = chooser(SkipConfig(enabled=False))(jax.random.key(0), placed, occupancy)
    assert np.all(kept) and np.all(np.asarray(weight) == 1.0)


def test_without_memory_all_inside_the_cube_is_evaluated() -> None:
    placed = place_samples(None, parallel_rays(6), ORIGIN, bound=1.0, count=SAMPLES)
    kept, weight = chooser(SkipConfig())(jax.random.key(0), placed, unknown_occupancy(4))
    np.testing.assert_array_equal(kept, np.asarray(placed.length) > 0)
    np.testing.assert_array_equal(weight, 1.0)


def test_exploration_is_unbiased() -> None:
    """A ball where nothing is remembered: the mean optical depth over many keys is the dense one."""
    skip = SkipConfig(explore=0.1)
    empty = Occupancy(density=jnp.zeros((CELLS,) * 3), known=jnp.array(True))
    placed = place_samples(None, parallel_rays(6), ORIGIN, bound=1.0, count=SAMPLES)
    tau = 1e-3 * np.random.default_rng(0).uniform(size=placed.length.shape) * np.asarray(placed.length)

    @jax.jit
    @jax.vmap
    def total(key: jax.Array) -> jax.Array:
        kept, weight = choose_samples(key, placed, ORIGIN, empty, bound=1.0, skip=skip)
        return jnp.sum(jnp.where(kept, weight * jnp.asarray(tau, jnp.float32), 0.0), axis=1)

    totals = np.asarray(total(jax.random.split(jax.random.key(3), 1000)), np.float64)
    dense = tau.sum(axis=1)
    error = totals.std(axis=0, ddof=1) / np.sqrt(len(totals))
    assert (np.abs(totals.mean(axis=0) - dense) <= 4 * error).all()
    assert abs(totals.mean() - dense.mean()) <= 4 * totals.mean(axis=1).std(ddof=1) / np.sqrt(len(totals))
    assert error.max() < 0.05 * dense.max()  # or the test could not fail


@functools.cache
def renderer(skip: SkipConfig) -> Callable:
    """(occupancy, density) -> Rendering, Tally of the two balls."""

    def run(occupancy: Occupancy, density: float) -> tuple:
        return render_rays(None, TWO, {"density": density}, parallel_rays(40), ORIGIN, occupancy, samples=96, bound=1.0, skip=skip)

    return jax.jit(run)


def render(skip: SkipConfig, occupancy: Occupancy, density: float) -> tuple[np.ndarray, int]:
    rendering, tally = renderer(skip)(occupancy, density)
    return np.asarray(rendering.transmittance), int(tally.evaluated)


@pytest.mark.parametrize("cells", [8, 32])
@pytest.mark.parametrize("density", [20.0, 300.0])
def test_termination_changes_no_pixel(density: float, cells: int) -> None:
    """Two balls, one behind the other's rim: rays that graze the first still see the second."""
    occupancy = known(TWO, density, cells=cells, refreshes=12)
    dense, _ = render(SkipConfig(enabled=False), occupancy, density)
    whole, every = render(SkipConfig(terminate=0.0), occupancy, density)
    ended, fewer = render(SkipConfig(terminate=1e-4), occupancy, density)
    np.testing.assert_allclose(whole, dense, atol=1e-3)
    np.testing.assert_allclose(ended, dense, atol=1e-3)
    assert fewer <= every
    if density == 300.0 and cells == 32:
        assert fewer < 0.75 * every  # or termination does nothing

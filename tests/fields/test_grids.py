"""Feature grids against loops over their vertices."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.interpolate
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.fields.grids import read_grid, resample, resampling_matrix, total_variation
from tests import reference

read = jax.jit(read_grid, static_argnames="bound")


def some_grid(cells: int, channels: int = 2, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(cells + 1,) * 3 + (channels,)).astype(np.float32)


@pytest.mark.parametrize(("coarse", "fine"), [(1, 1), (1, 4), (3, 3), (3, 7), (4, 8), (5, 2), (6, 40)])
def test_resampling_is_linear_interpolation_along_an_axis(coarse: int, fine: int) -> None:
    values = np.random.default_rng(0).normal(size=coarse + 1)
    expected = np.interp(np.linspace(0, 1, fine + 1), np.linspace(0, 1, coarse + 1), values)
    matrix = resampling_matrix(coarse, fine)
    # Weights are float32 differences of places up to `coarse`.
    np.testing.assert_allclose(matrix @ values, expected, atol=2e-7 * max(coarse, 8))
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=2e-7 * max(coarse, 1))


def test_resampling_is_trilinear() -> None:
    grid = some_grid(3)
    np.testing.assert_allclose(resample(jnp.asarray(grid), resolution=5), reference.resample(grid, 5), atol=2e-6)


def test_resampling_keeps_linear_functions_and_the_grid_itself() -> None:
    axes = [np.linspace(-1, 1, 4)] * 3
    x, y, z = np.meshgrid(*axes, indexing="ij")
    grid = np.stack([1 + 2 * x - 3 * y + 4 * z, x - z], axis=-1).astype(np.float32)
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, 8)] * 3, indexing="ij")
    np.testing.assert_allclose(resample(jnp.asarray(grid), resolution=7)[..., 0], 1 + 2 * x - 3 * y + 4 * z, atol=4e-6)
    np.testing.assert_array_equal(resample(jnp.asarray(grid), resolution=3), grid)


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), bound=st.sampled_from([0.25, 1.0, 8.0]))
def test_reading_is_trilinear_inside_and_the_nearest_face_outside(seed: int, bound: float) -> None:
    grid = some_grid(4, seed=seed)
    points = np.float32(np.random.default_rng(seed).uniform(-1.6, 1.6, (20, 3)) * bound)
    twin = [reference.read_grid(np.float64(grid), point, bound) for point in points]
    # The place in cells is rounded to 4 x 6e-8; neighbouring vertices differ by up to 8.
    np.testing.assert_allclose(read(jnp.asarray(grid), jnp.asarray(points), bound=bound), twin, atol=1e-5)


def test_reading_agrees_with_scipy() -> None:
    grid, bound = some_grid(5, seed=3), 1.5
    points = np.random.default_rng(4).uniform(-bound, bound, (200, 3)).astype(np.float32)
    trusted = scipy.interpolate.RegularGridInterpolator([np.linspace(-bound, bound, 6)] * 3, np.float64(grid))(points)
    np.testing.assert_allclose(read(jnp.asarray(grid), jnp.asarray(points), bound=bound), trusted, atol=1e-5)


def test_on_a_vertex_it_is_the_vertex() -> None:
    grid = some_grid(4)
    index = np.array(list(np.ndindex(5, 5, 5)))
    points = jnp.asarray(index / 2.0 - 1.0, jnp.float32)
    np.testing.assert_array_equal(read(jnp.asarray(grid), points, bound=1.0), grid.reshape(-1, 2))


@pytest.mark.parametrize("far", [1.0 + 1e-7, 2.0, 1e30])
def test_far_outside_it_is_the_corner(far: float) -> None:
    grid = some_grid(4)
    points = jnp.asarray([[far, far, far], [-far, far, -far]], jnp.float32)
    np.testing.assert_allclose(read(jnp.asarray(grid), points, bound=1.0), [grid[4, 4, 4], grid[0, 4, 0]], atol=1e-6)


def test_gradient_in_the_grid_is_its_interpolation_weights() -> None:
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (6, 3)).astype(np.float32)
    pull = np.random.default_rng(1).normal(size=(6, 1)).astype(np.float32)
    grid = jnp.asarray(some_grid(2, 1))
    gradient = jax.grad(lambda grid: jnp.sum(jnp.asarray(pull) * read_grid(grid, jnp.asarray(points), bound=1.0)))(grid)
    expected = np.zeros((3, 3, 3, 1))
    for index in np.ndindex(3, 3, 3):  # the reading is linear in the grid, so a single vertex of 1 shows its weight
        one = np.zeros((3, 3, 3, 1))
        one[index] = 1.0
        expected[index] = sum(float(p[0]) * reference.read_grid(one, point, 1.0) for p, point in zip(pull, points, strict=True))
    np.testing.assert_allclose(gradient, expected, atol=2e-6)


def test_total_variation_against_a_loop() -> None:
    grid = some_grid(3)
    assert float(total_variation(jnp.asarray(grid))) == pytest.approx(reference.total_variation(np.float64(grid)), rel=2e-6)
    assert float(total_variation(jnp.full((4, 4, 4, 2), 7.0))) == 0.0


@pytest.mark.parametrize("count", [0, 1])
def test_few_points(count: int) -> None:
    assert read(jnp.asarray(some_grid(2)), jnp.zeros((count, 3)), bound=1.0).shape == (count, 2)

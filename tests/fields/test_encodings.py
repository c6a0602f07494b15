"""The integrated random Fourier encoding against its definition: an expectation over a Gaussian."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.fields.encodings import integrated_encoding, projected_variance, sample_frequencies
from dreamfields_core.types import Gaussians
from tests import reference

pytestmark = pytest.mark.usefixtures("strict_dtypes")

encode = jax.jit(integrated_encoding)
project = jax.jit(projected_variance)


def some_gaussians(seed: int, count: int, *, spread: float) -> tuple[Gaussians, np.ndarray]:
    """Float32 Gaussians, and their 3 x 3 covariances in float64."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions = np.float32(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    means = np.float32(rng.uniform(-1.5, 1.5, (count, 3)))
    along, across = np.float32(spread * rng.uniform(size=count)), np.float32(0.1 * spread * rng.uniform(size=count))
    matrices = np.stack(
        [reference.covariance(np.float64(d), float(a), float(b)) for d, a, b in zip(directions, along, across, strict=True)]
    )
    return Gaussians(*(jnp.asarray(value) for value in (means, directions, along, across))), matrices


def test_it_is_the_expectation_over_the_gaussian() -> None:
    frequencies = np.array([[1.0, 0.0, 0.0], [2.0, -1.0, 4.0], [0.3, 0.2, -0.1]], np.float32)
    gaussians, matrices = some_gaussians(0, 4, spread=0.3)
    ours = np.asarray(encode(jnp.asarray(frequencies), gaussians))
    rng = np.random.default_rng(1)
    draws = 200_000
    for number, matrix in enumerate(matrices):
        points = rng.multivariate_normal(np.asarray(gaussians.means[number], np.float64), matrix, size=draws)
        phases = points @ frequencies.T
        expected = np.concatenate([points.mean(0), np.sin(phases).mean(0), np.cos(phases).mean(0)])
        # Standard error at most 1 / sqrt(draws); five of them.
        np.testing.assert_allclose(ours[number], expected, atol=5 / np.sqrt(draws))


def test_it_is_the_closed_form_with_the_whole_covariance() -> None:
    frequencies = np.asarray(sample_frequencies(jax.random.key(0), 32, levels=8.0))
    gaussians, matrices = some_gaussians(2, 16, spread=1e-2)
    twin = [
        reference.encoding(np.float64(frequencies), np.float64(mean), matrix)
        for mean, matrix in zip(gaussians.means, matrices, strict=True)
    ]
    # The phase reaches 256 x 2.6 radians, of which float32 keeps 6e-5.
    np.testing.assert_allclose(encode(jnp.asarray(frequencies), gaussians), twin, atol=1e-4)


@pytest.mark.parametrize("spread", [1e-12, 1e-4, 1.0, 1e4])
def test_two_projections_are_the_whole_covariance(spread: float) -> None:
    frequencies = np.asarray(sample_frequencies(jax.random.key(1), 64, levels=8.0))
    gaussians, matrices = some_gaussians(3, 16, spread=spread)
    twin = np.einsum("fi,nij,fj->nf", *(np.float64(value) for value in (frequencies, matrices, frequencies)))
    # |f|^2 - (d f)^2 cancels where f is along d: an error of 2e-7 |f|^2 across variance, which itself is in the twin's sum.
    whole = np.sum(np.float64(frequencies) ** 2, axis=1)[None, :] * np.float64(gaussians.across)[:, None]
    assert (np.abs(project(jnp.asarray(frequencies), gaussians) - twin) <= 2e-6 * twin + 4e-7 * whole).all()


def test_variance_is_never_negative_along_the_ray_itself() -> None:
    direction = np.float32([[0.36, 0.48, 0.8]])
    frequencies = jnp.asarray(direction * np.float32(256.0))
    gaussians = Gaussians(jnp.zeros((1, 3)), jnp.asarray(direction), jnp.zeros(1), jnp.full(1, 1e6))
    assert float(project(frequencies, gaussians)[0, 0]) >= 0.0
    assert float(jnp.abs(encode(frequencies, gaussians)).max()) <= 1.0


def test_without_extent_it_is_plain_fourier_features() -> None:
    frequencies = jnp.asarray(np.random.default_rng(4).normal(size=(8, 3)), jnp.float32)
    points = np.random.default_rng(5).uniform(-1, 1, (10, 3))
    phases = np.float64(np.float32(points)) @ np.float64(frequencies).T
    expected = np.concatenate([points, np.sin(phases), np.cos(phases)], axis=1)
    np.testing.assert_allclose(encode(frequencies, points_as_gaussians(jnp.asarray(points, jnp.float32))), expected, atol=2e-6)


def test_a_wide_gaussian_forgets_high_frequencies() -> None:
    gaussians = Gaussians(jnp.full((1, 3), 0.3), jnp.array([[1.0, 0.0, 0.0]]), jnp.full(1, 1e30), jnp.full(1, 1e30))
    encoded = np.asarray(encode(jnp.eye(3) * 256.0, gaussians))
    np.testing.assert_array_equal(encoded[0, 3:], 0.0)


def test_gradient_in_the_means_against_finite_differences() -> None:
    frequencies = np.random.default_rng(6).normal(size=(6, 3)) * 3.0
    gaussians, matrices = some_gaussians(7, 3, spread=0.05)
    mix = np.random.default_rng(8).normal(size=(3, 15))

    def ours(means: jax.Array) -> jax.Array:
        return jnp.sum(
            jnp.asarray(mix, jnp.float32) * integrated_encoding(jnp.asarray(frequencies, jnp.float32), gaussians.replace(means=means))
        )

    gradient = np.asarray(jax.jit(jax.grad(ours))(gaussians.means))
    for number, matrix in enumerate(matrices):

        def twin(mean: np.ndarray, number: int = number, matrix: np.ndarray = matrix) -> float:
            return float(mix[number] @ reference.encoding(frequencies, mean, matrix))

        for axis in range(3):
            expected = reference.slope(twin, np.float64(gaussians.means[number]), np.eye(3)[axis])
            # Sum of 15 terms of size up to 10, each to some 1e-6.
            assert gradient[number, axis] == pytest.approx(expected, abs=5e-5)


def test_frequencies_are_uniform_in_octave_and_direction() -> None:
    frequencies = np.asarray(jax.jit(lambda key: sample_frequencies(key, 20_000, levels=8.0))(jax.random.key(2)), np.float64)
    norms = np.linalg.norm(frequencies, axis=1)
    octaves = np.log2(norms)
    assert octaves.min() >= -1e-6 and octaves.max() <= 8 + 1e-6
    assert scipy.stats.kstest(octaves, "uniform", args=(0, 8)).pvalue > 1e-3
    directions = frequencies / norms[:, None]
    # Archimedes: each coordinate of a uniform direction is uniform on [-1, 1]; so is its part along any other direction.
    for axis in (*np.eye(3), np.ones(3) / np.sqrt(3)):
        assert scipy.stats.kstest(directions @ axis, "uniform", args=(-1, 2)).pvalue > 1e-3
    # Length and direction are drawn apart: standard error of the correlation 0.007.
    assert abs(np.corrcoef(octaves, directions[:, 0])[0, 1]) < 0.03


def test_the_key_decides_the_frequencies() -> None:
    one, same, other = (np.asarray(sample_frequencies(jax.random.key(seed), 8, levels=8.0)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one != other).all()

"""Samples along rays: their pieces fill the chord, they stay inside, and their Gaussians are those of conical frustums."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.rendering.sampling import Samples, gaussians_at, place_samples, step_length
from dreamfields_core.types import Gaussians, Rays
from tests import reference

RAYS, COUNT = 40, 24
place = jax.jit(place_samples, static_argnames=("bound", "count"))


def some_rays(seed: int, bound: float) -> Rays:
    """From outside toward somewhere in or near the cube, and some from within."""
    rng = np.random.default_rng(seed)
    starts = rng.normal(size=(RAYS, 3)) * np.where(np.arange(RAYS) % 8 == 0, 0.3, 3.0)[:, None] * bound
    aims = rng.uniform(-1.2, 1.2, (RAYS, 3)) * bound - starts
    directions = aims / np.linalg.norm(aims, axis=1, keepdims=True)
    return Rays(jnp.asarray(starts, jnp.float32), jnp.asarray(directions, jnp.float32), jnp.full((RAYS, 1), 1e-3))


@settings(max_examples=12)
@given(seed=st.integers(0, 10**6), bound=st.sampled_from([0.5, 1.0, 20.0]), jitter=st.booleans())
def test_pieces_fill_the_chord_and_samples_stay_in_theirs(seed: int, bound: float, jitter: bool) -> None:
    rays = some_rays(seed, bound)
    origin = np.float32(np.random.default_rng(seed + 1).uniform(-0.2, 0.2, 3) * bound)
    placed = place(jax.random.key(seed) if jitter else None, rays, jnp.asarray(origin), bound=bound, count=COUNT)
    chords = [
        reference.ray_cube(start, toward, np.zeros(3), bound)
        for start, toward in zip(np.asarray(rays.origins) - origin, np.asarray(rays.directions), strict=True)
    ]
    near, far = np.array(chords).T
    length, step = np.asarray(placed.length, np.float64), float(placed.step)
    np.testing.assert_allclose(length.sum(axis=1), far - near, rtol=1e-5, atol=1e-5 * bound)
    assert (length >= 0).all() and (length <= step).all()
    # Full pieces, then one that is shorter, then nothing.
    assert (np.diff(length, axis=1) <= 0).all()
    offset = np.asarray(placed.distances(), np.float64) - near[:, None] - np.arange(COUNT)[None, :] * step
    present = length > 0
    assert (offset >= -1e-5 * bound)[present].all() and (offset <= length + 1e-5 * bound)[present].all()
    points = np.asarray(rays.origins)[:, None] + np.asarray(placed.distances())[..., None] * np.asarray(rays.directions)[:, None]
    assert np.abs(points - origin)[present].max(initial=0.0) <= bound * (1 + 1e-5)
    if not jitter:
        np.testing.assert_allclose(offset[present], 0.5 * length[present], atol=1e-5 * bound)


def test_jitter_is_uniform_within_the_piece_and_decided_by_its_key() -> None:
    rays = some_rays(0, 1.0)
    one, same, other = (place(jax.random.key(seed), rays, jnp.zeros(3), bound=1.0, count=COUNT) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.shift, same.shift)
    assert np.any(np.asarray(one.shift) != np.asarray(other.shift))
    full = np.asarray(one.length) >= float(one.step) * (1 - 1e-6)
    shift = np.asarray(one.shift)[full]
    # Some 500 draws: standard errors of mean and variance 0.013 and 0.003.
    assert shift.mean() == pytest.approx(0.5, abs=0.05) and shift.var() == pytest.approx(1 / 12, abs=0.012)


def test_the_diagonal_takes_all_samples_and_a_miss_none() -> None:
    diagonal = np.float32([[-3, -3, -3], [-4, 3, 0]])
    toward = np.float32([[3**-0.5] * 3, [1, 0, 0]])
    rays = Rays(jnp.asarray(diagonal), jnp.asarray(toward), jnp.full((2, 1), 1e-3))
    placed = place(None, rays, jnp.zeros(3), bound=1.0, count=COUNT)
    assert (np.asarray(placed.length[0]) > 0.99 * step_length(bound=1.0, count=COUNT)).all()
    np.testing.assert_array_equal(placed.length[1], 0.0)
    assert step_length(bound=2.0, count=10) == pytest.approx(4 * 3**0.5 / 10)


def frustums(middle: np.ndarray, half: np.ndarray, radius: np.ndarray) -> Gaussians:
    """`gaussians_at` for one frustum a ray, along x from the world's origin."""
    count = len(middle)

    def one(near: jax.Array, step: jax.Array, radius: jax.Array) -> Gaussians:
        rays = Rays(jnp.zeros((1, 3)), jnp.array([[1.0, 0.0, 0.0]]), radius.reshape(1, 1))
        samples = Samples(rays=rays, near=near[None], shift=jnp.full((1, 1), 0.5), length=step.reshape(1, 1), step=step)
        return jax.tree.map(lambda leaf: leaf[0], gaussians_at(samples, jnp.zeros(1, jnp.int32)))

    near = np.float32(middle) - np.float32(half)
    values = [jnp.asarray(np.broadcast_to(value, count), jnp.float32) for value in (near, 2 * np.float32(half), radius)]
    return jax.jit(jax.vmap(one))(*values)


@pytest.mark.parametrize("share", [1.0, 0.5, 1e-2, 1e-4, 1e-6])
def test_gaussians_are_the_frustums_moments_at_any_distance(share: float) -> None:
    """Distances 1e-8 to 1e4, half-widths from the whole distance (a cone from its tip) to a millionth of it."""
    middle = np.float32(10.0 ** np.arange(-8, 5))
    half = np.float32(share) * middle
    radius = np.float32(0.01)
    ours = frustums(middle, half, radius)
    # The core rounds near = middle - half and adds half again: the twin starts from what it then has.
    rounded = (middle - half) + half
    twin = np.array([reference.frustum(float(c), float(h), float(radius)) for c, h in zip(rounded, half, strict=True)])
    np.testing.assert_allclose(ours.means[:, 0], twin[:, 0], rtol=5e-7)
    np.testing.assert_allclose(ours.along, twin[:, 1], rtol=2e-6)
    np.testing.assert_allclose(ours.across, twin[:, 2], rtol=2e-6)


def test_gaussians_are_what_points_in_the_cone_have() -> None:
    rng = np.random.default_rng(0)
    middle, half, radius, draws = 2.0, 0.8, 0.3, 400_000
    near, far = middle - half, middle + half
    distance = (near**3 + rng.uniform(size=draws) * (far**3 - near**3)) ** (1 / 3)  # density t^2: the cone's cross-section
    out = radius * distance * np.sqrt(rng.uniform(size=draws))
    sideways = out * np.cos(2 * np.pi * rng.uniform(size=draws))
    ours = frustums(np.array([middle]), np.array([half]), np.array(radius))
    # Relative standard error of a variance is some sqrt(2 / draws) = 0.2 %.
    assert float(ours.means[0, 0]) == pytest.approx(distance.mean(), rel=2e-3)
    assert float(ours.along[0]) == pytest.approx(distance.var(), rel=1e-2)
    assert float(ours.across[0]) == pytest.approx(sideways.var(), rel=1e-2)


def test_flat_indices_find_their_ray_and_place() -> None:
    rays = some_rays(3, 1.0)
    placed = place(None, rays, jnp.zeros(3), bound=1.0, count=COUNT)
    index = np.array([0, COUNT - 1, COUNT, 5 * COUNT + 7, RAYS * COUNT - 1])
    gaussians = gaussians_at(placed, jnp.asarray(index))
    distances, steps = np.asarray(placed.distances(), np.float64), float(placed.step)
    for number, (ray, place_of) in enumerate(zip(*np.divmod(index, COUNT), strict=True)):
        mean, along, across = reference.frustum(float(distances[ray, place_of]), steps / 2, 1e-3)
        where = np.float64(rays.origins[ray]) + mean * np.float64(rays.directions[ray])
        np.testing.assert_allclose(gaussians.means[number], where, atol=3e-6)
        np.testing.assert_allclose([gaussians.along[number], gaussians.across[number]], [along, across], rtol=1e-5)
        np.testing.assert_array_equal(gaussians.directions[number], rays.directions[ray])

"""Ray and cube against slabs in float64: generic rays, and all the special ones."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.scene.cube import ray_cube
from dreamfields_core.types import Rays
from tests import reference

pytestmark = pytest.mark.usefixtures("strict_dtypes")


crossing = jax.jit(lambda rays, origin, bound: ray_cube(rays, origin, bound=bound))


def cross(starts: np.ndarray, directions: np.ndarray, origin: np.ndarray, bound: float) -> tuple[np.ndarray, np.ndarray]:
    rays = Rays(jnp.asarray(starts, jnp.float32), jnp.asarray(directions, jnp.float32), jnp.ones((len(starts), 1)))
    near, far = crossing(rays, jnp.asarray(origin, jnp.float32), bound)
    return np.asarray(near), np.asarray(far)


def twin(starts: np.ndarray, directions: np.ndarray, origin: np.ndarray, bound: float) -> tuple[np.ndarray, np.ndarray]:
    """From the same float32 inputs; starts relative to the origin are rounded as the core must round them."""
    relative = np.asarray(starts, np.float32) - np.asarray(origin, np.float32)
    crossed = [reference.ray_cube(s, d, np.zeros(3), bound) for s, d in zip(relative, np.asarray(directions, np.float32), strict=True)]
    return np.array([near for near, _ in crossed]), np.array([far for _, far in crossed])


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), bound=st.sampled_from([2.0**-10, 0.5, 1.0, 100.0]), distance=st.sampled_from([0.0, 0.5, 2.0, 50.0]))
def test_random_rays(seed: int, bound: float, distance: float) -> None:
    rng = np.random.default_rng(seed)
    starts = rng.normal(size=(64, 3)) * distance * bound
    aims = rng.uniform(-1.3, 1.3, (64, 3)) * bound - starts
    directions = aims / np.linalg.norm(aims, axis=1, keepdims=True) * rng.choice([-1.0, 1.0], (64, 1), p=[0.2, 0.8])
    origin = rng.normal(size=3) * 0.1 * bound
    near, far = cross(starts, directions, origin, bound)
    exact_near, exact_far = twin(starts, directions, origin, bound)
    # A subtraction, a reciprocal and a product: three roundings of 6e-8 each. Where hit or miss hangs on less, either is right.
    scale = bound + np.abs(starts).max()
    decided = np.abs(exact_far - exact_near) > 1e-5 * scale
    assert (near <= far).all() and (near >= 0).all()
    np.testing.assert_allclose(near[decided], exact_near[decided], rtol=4e-7, atol=1e-7 * scale)
    np.testing.assert_allclose(far[decided], exact_far[decided], rtol=4e-7, atol=1e-7 * scale)
    missed = exact_far == 0
    assert (far - near)[missed].max(initial=0.0) <= 1e-5 * scale


SPECIAL = {
    "along x": ([-4, 0, 0], [1, 0, 0], 3, 5),
    "against x": ([4, 0, 0], [-1, 0, 0], 3, 5),
    "along y": ([0.5, -4, 0.25], [0, 1, 0], 3, 5),
    "along z": ([0, 0, -2], [0, 0, 1], 1, 3),
    "along negative zeros": ([-4, 0, 0], [1, -0.0, -0.0], 3, 5),
    "in a face": ([-4, 1, 0], [1, 0, 0], 3, 5),
    "in an edge": ([-4, 1, -1], [1, 0, 0], 3, 5),
    "just outside a face": ([-4, 1.0001, 0], [1, 0, 0], 0, 0),
    "through two corners": ([-3, -3, -3], [3**-0.5] * 3, 2 * 3**0.5, 4 * 3**0.5),
    "through two edges": ([-3, -3, 0], [2**-0.5, 2**-0.5, 0], 2 * 2**0.5, 4 * 2**0.5),
    "touching an edge": ([-2, 0, 0], [2**-0.5, 2**-0.5, 0], 0, 0),
    "touching a corner": ([0, 2, -1], [0.5**0.5, -(0.5**0.5), 0], 0, 0),
    "missing": ([-4, 3, 0], [1, 0, 0], 0, 0),
    "missing askew": ([-4, 0, 0], [0.6, 0.8, 0], 0, 0),
    "behind": ([4, 0, 0], [1, 0, 0], 0, 0),
    "from the centre": ([0, 0, 0], [0, 0, 1], 0, 1),
    "from the centre to a corner": ([0, 0, 0], [3**-0.5] * 3, 0, 3**0.5),
    "from inside": ([0.5, 0, 0], [-1, 0, 0], 0, 1.5),
    "from a face inward": ([1, 0, 0], [-1, 0, 0], 0, 2),
    "from a face outward": ([1, 0, 0], [1, 0, 0], 0, 0),
    "from a corner inward": ([1, 1, 1], [-(3**-0.5)] * 3, 0, 2 * 3**0.5),
    "zero on the slab's own plane": ([0, -3, 0], [0, 1, 0], 2, 4),
    "almost parallel": ([-4, 0, 0], [1, 1e-20, 1e-13], 3, 5),
    "almost parallel, outside": ([-4, 2, 0], [1, -1e-13, 0], 0, 0),
}


@pytest.mark.parametrize("name", SPECIAL)
def test_special_rays(name: str) -> None:
    start, direction, enter, leave = SPECIAL[name]
    near, far = cross([start], [direction], np.zeros(3), 1.0)
    # Exact but for roots in the direction.
    np.testing.assert_allclose([near[0], far[0]], [enter, leave], rtol=3e-7, atol=5e-7)


def test_every_axis_face_edge_and_corner_and_their_gradients_are_finite() -> None:
    steps = [np.array(step, float) for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]
    directions = np.stack([step / np.linalg.norm(step) for step in steps])
    places = np.array(list(itertools.product((-2.0, -1.0, 0.0, 1.0, 2.0), repeat=3)))
    starts = np.repeat(places, len(directions), axis=0)
    aims = np.tile(directions, (len(places), 1))
    near, far = cross(starts, aims, np.zeros(3), 1.0)
    assert np.isfinite(near).all() and np.isfinite(far).all()
    exact_near, exact_far = twin(starts, aims, np.zeros(3), 1.0)
    # Through an edge or a corner of no length, hit or miss hangs on the last digit: then the length is what must agree.
    np.testing.assert_allclose(far - near, exact_far - exact_near, atol=2e-6)
    clear = exact_far - exact_near > 1e-5
    np.testing.assert_allclose(near[clear], exact_near[clear], atol=2e-6)

    def total(start: jax.Array, direction: jax.Array, origin: jax.Array) -> jax.Array:
        near, far = ray_cube(Rays(start, direction, jnp.ones((len(starts), 1))), origin, bound=1.0)
        return jnp.sum(near) + 2.0 * jnp.sum(far)

    gradients = jax.grad(total, argnums=(0, 1, 2))(jnp.asarray(starts, jnp.float32), jnp.asarray(aims, jnp.float32), jnp.zeros(3))
    assert all(np.isfinite(gradient).all() for gradient in gradients)


def test_gradients_against_finite_differences() -> None:
    start, direction = np.array([-3.0, 0.25, -0.5]), np.array([0.96, 0.0, 0.28])

    def chord(x: np.ndarray) -> float:
        near, far = reference.ray_cube(x[:3], x[3:], np.zeros(3), 1.0)
        return 2.0 * far - near

    def ours(x: jax.Array) -> jax.Array:
        near, far = ray_cube(Rays(x[None, :3], x[None, 3:], jnp.ones((1, 1))), jnp.zeros(3), bound=1.0)
        return jnp.sum(2.0 * far - near)

    at = np.concatenate([start, direction])
    gradient = np.asarray(jax.grad(ours)(jnp.asarray(at, jnp.float32)))
    for axis in (0, 1, 2, 3, 5):  # not along the zero component, where the case changes
        assert gradient[axis] == pytest.approx(reference.slope(chord, at, np.eye(6)[axis]), abs=2e-5)


@pytest.mark.parametrize("shape", [(0,), (1,), (2, 3)])
def test_shapes(shape: tuple) -> None:
    rays = Rays(jnp.zeros((*shape, 3)), jnp.ones((*shape, 3)), jnp.ones((*shape, 1)))
    near, far = ray_cube(rays, jnp.zeros(3), bound=1.0)
    assert near.shape == far.shape == shape

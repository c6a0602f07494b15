"""The tracked origin against a moving average written out."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.scene.origin import track_origin
from tests import reference


def test_moving_average_over_many_steps() -> None:
    rng = np.random.default_rng(0)
    ours, twin = jnp.zeros(3), np.zeros(3)
    for _ in range(50):
        opacities, points = rng.uniform(size=20), rng.normal(size=(20, 3)) + 1.0
        ours = track_origin(ours, jnp.float32(opacities.sum()), jnp.asarray(opacities @ points, jnp.float32), decay=0.9)
        twin = reference.track_origin(twin, opacities, points, 0.9)
    # Rounding of each step is damped by the decay: some ten of them at 6e-8 of a value near 1.
    np.testing.assert_allclose(ours, twin, rtol=2e-6)
    assert np.linalg.norm(ours - np.ones(3)) < 0.5


def test_an_empty_scene_keeps_its_origin() -> None:
    origin = jnp.array([0.1, -0.2, 0.3])
    for mass in (0.0, 1e-30, 1e-7):
        np.testing.assert_array_equal(track_origin(origin, jnp.float32(mass), jnp.full(3, mass), decay=0.5), origin)


def test_decay_of_one_and_of_zero() -> None:
    origin, mass, moment = jnp.array([0.1, -0.2, 0.3]), jnp.float32(2.0), jnp.array([2.0, 4.0, 6.0])
    np.testing.assert_array_equal(track_origin(origin, mass, moment, decay=1.0), origin)
    np.testing.assert_allclose(track_origin(origin, mass, moment, decay=0.0), [1.0, 2.0, 3.0])


def test_the_gradient_is_finite_where_nothing_is() -> None:
    gradient = jax.grad(lambda mass, moment: jnp.sum(track_origin(jnp.zeros(3), mass, moment, decay=0.9)), argnums=(0, 1))
    for value in gradient(jnp.float32(0.0), jnp.zeros(3)):
        assert np.isfinite(value).all()

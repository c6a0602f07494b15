"""What changes over a dream, and what it minimises, against the paper's numbers and formulas."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import CameraConfig, LossConfig, OptimConfig
from dreamfields_core.dreaming.losses import (
    beta_prior,
    clipped_gated,
    clipped_transmittance,
    cosines,
    gated,
    regularized,
)
from dreamfields_core.dreaming.schedules import density_noise, geometric, learning_rate, target_transmittance
from dreamfields_core.scene.cameras import FOCAL_UNIT, Pose, sample_poses
from tests import reference


@pytest.mark.parametrize(("start", "end", "steps"), [(1e-5, 1e-4, 1500), (0.5, 0.1, 500), (3.0, 3.0, 10), (1.0, 2.0, 0)])
def test_geometric_is_a_straight_line_of_logarithms(start: float, end: float, steps: int) -> None:
    at = [0, 1, steps // 3, steps // 2, max(steps - 1, 0), steps, 10 * steps + 1]
    ours = [float(geometric(jnp.int32(step), start=start, end=end, steps=steps)) for step in at]
    # A float32 power of a ratio: exponent and logarithm rounded once each.
    np.testing.assert_allclose(ours, [reference.geometric(step, start, end, steps) for step in at], rtol=2e-6)


def test_learning_rate_of_the_paper() -> None:
    optim = OptimConfig()
    rates = [float(learning_rate(jnp.int32(step), optim)) for step in (0, 750, 1500, 9999)]
    np.testing.assert_allclose(rates, [1e-5, 1e-4 / 10**0.5, 1e-4, 1e-4], rtol=2e-6)


def test_learning_rate_that_ends_in_a_cosine() -> None:
    optim = OptimConfig(steps=300, rate_start=3e-3, rate=3e-2, warmup_steps=100, rate_end=3e-3)
    rates = [float(learning_rate(jnp.int32(step), optim)) for step in (0, 100, 150, 200, 300, 1000)]
    quarter = 3e-3 + 2.7e-2 * 0.5 * (1 + np.cos(np.pi / 4))
    np.testing.assert_allclose(rates, [3e-3, 3e-2, quarter, 1.65e-2, 3e-3, 3e-3], rtol=3e-6)


def paper_pose(**changes: float) -> Pose:
    values = {"azimuth": 0.0, "elevation": 0.5, "radius": 4.0, "focal": 1.2 * FOCAL_UNIT} | changes
    return Pose(**{name: jnp.full(1, value) for name, value in values.items()})


@pytest.mark.parametrize(("step", "tau"), [(0, 0.4), (250, 1 - 1.2 * 0.05**0.5), (500, 0.88), (9000, 0.88)])
def test_target_at_the_papers_camera(step: int, tau: float) -> None:
    assert float(target_transmittance(jnp.int32(step), paper_pose(), LossConfig())[0]) == pytest.approx(tau, abs=1e-6)


def test_target_of_the_drawn_default_camera() -> None:
    pose = sample_poses(jax.random.key(0), CameraConfig(views=3))
    np.testing.assert_allclose(target_transmittance(jnp.int32(0), pose, LossConfig()), [0.4] * 3, atol=1e-6)


def test_target_opacity_grows_with_the_area_in_the_picture() -> None:
    near = 1 - float(target_transmittance(jnp.int32(500), paper_pose(radius=2.0), LossConfig())[0])
    far = 1 - float(target_transmittance(jnp.int32(500), paper_pose(radius=8.0), LossConfig())[0])
    long = 1 - float(target_transmittance(jnp.int32(500), paper_pose(focal=2.4 * FOCAL_UNIT), LossConfig())[0])
    np.testing.assert_allclose([near, far, long], [0.48, 0.03, 0.48], atol=1e-6)
    assert float(target_transmittance(jnp.int32(0), paper_pose(radius=0.5), LossConfig())[0]) == 0.0


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), target=st.floats(0.0, 1.0))
def test_transmittance_loss_against_its_formula(seed: int, target: float) -> None:
    rng = np.random.default_rng(seed)
    transmittance, targets = np.float32(rng.uniform(size=(2, 3, 4))), np.float32([target, 0.5])
    ours = float(clipped_transmittance(jnp.asarray(transmittance), jnp.asarray(targets)))
    assert ours == pytest.approx(reference.clipped_transmittance(np.float64(transmittance), np.float64(targets)), abs=2e-7)


def test_transmittance_loss_pulls_below_its_target_and_not_above() -> None:
    transmittance = jnp.stack([jnp.full((3, 4), 0.3), jnp.full((3, 4), 0.9)])
    gradient = np.asarray(jax.grad(clipped_transmittance)(transmittance, jnp.array([0.5, 0.5])))
    # d / dT of -mean over 2 views of the mean over 12 pixels.
    np.testing.assert_allclose(gradient[0], -1 / 24, rtol=1e-6)
    np.testing.assert_array_equal(gradient[1], 0.0)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_transmittance_loss_is_finite_at_the_ends(value: float) -> None:
    loss, gradient = jax.value_and_grad(clipped_transmittance)(jnp.full((1, 2, 2), value), jnp.array([0.88]))
    assert float(loss) == pytest.approx(-min(value, 0.88)) and np.isfinite(gradient).all()


def test_cosines_are_those_of_unit_vectors() -> None:
    rng = np.random.default_rng(0)
    images, text = rng.normal(size=(6, 5)), rng.normal(size=5)
    images, text = images / np.linalg.norm(images, axis=1, keepdims=True), text / np.linalg.norm(text)
    found = cosines(jnp.asarray(images, jnp.float32), jnp.asarray(text, jnp.float32))
    np.testing.assert_allclose(found, [float(image @ text) for image in images], atol=2e-7)


def test_each_picture_may_have_a_caption_of_its_own() -> None:
    rng = np.random.default_rng(1)
    images, texts = rng.normal(size=(4, 5)), rng.normal(size=(4, 5))
    ours = cosines(jnp.asarray(images, jnp.float32), jnp.asarray(texts, jnp.float32))
    np.testing.assert_allclose(ours, [float(image @ text) for image, text in zip(images, texts, strict=True)], atol=2e-6)


def test_density_noise_falls_evenly_and_then_stays() -> None:
    loss = LossConfig(noise_start=2.0, noise_end=0.5, noise_steps=100)
    np.testing.assert_allclose([float(density_noise(jnp.int32(step), loss)) for step in (0, 50, 100, 9999)], [2.0, 1.25, 0.5, 0.5])
    assert float(density_noise(jnp.int32(9999), LossConfig())) == 1.0


def twin_of(name: str, cosines: np.ndarray, transmittance: np.ndarray, target: np.ndarray) -> float:
    """L_total as the rows of the paper's table 2 say it, view by view, with its weights of 0.5 and 0.001."""
    copies = len(cosines) // len(target)
    total = 0.0
    for view, tau in enumerate(target):
        cosine = float(cosines[view * copies : (view + 1) * copies].mean())
        clear = transmittance[view]
        mean = float(clear.mean())
        total += {
            "none": -cosine,
            "density_noise": -cosine,
            "beta_prior": -cosine + 1e-3 * float(np.mean(np.log(np.maximum(clear, 1e-6)) + np.log(np.maximum(1 - clear, 1e-6)))),
            "gated": -mean * cosine,
            "clipped_gated": -min(tau, mean) * cosine,
            "clipped_additive": -cosine - 0.5 * min(tau, mean),
        }[name]
    return total / len(target)


NAMES = ("none", "density_noise", "beta_prior", "gated", "clipped_gated", "clipped_additive")


@pytest.mark.parametrize("name", NAMES)
def test_every_regulariser_is_its_row_of_table_3(name: str) -> None:
    rng = np.random.default_rng(2)
    transmittance, target = np.float32(rng.uniform(size=(3, 4, 4))), np.float32([0.2, 0.5, 0.9])
    scores = np.float32(rng.uniform(-1, 1, 6))
    ours = float(regularized(jnp.asarray(scores), jnp.asarray(transmittance), jnp.asarray(target), LossConfig(regularizer=name)))
    assert ours == pytest.approx(twin_of(name, np.float64(scores), np.float64(transmittance), np.float64(target)), abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [0.0, 1e-30, 1e-6, 0.5, 1.0 - 2.0**-24, 1.0])
def test_every_regulariser_and_its_gradients_are_finite_at_the_ends(name: str, value: float) -> None:
    def total(scores: jax.Array, transmittance: jax.Array) -> jax.Array:
        return regularized(scores, transmittance, jnp.array([0.88]), LossConfig(regularizer=name))

    values, gradients = jax.value_and_grad(total, argnums=(0, 1))(jnp.array([0.3, 0.2]), jnp.full((1, 2, 2), value, jnp.float32))
    assert np.isfinite(values) and all(np.isfinite(gradient).all() for gradient in gradients)


def test_the_beta_prior_pushes_each_ray_to_the_end_that_is_nearer() -> None:
    transmittance = jnp.asarray([[[0.01, 0.3, 0.5, 0.7, 0.99]]])
    gradient = np.asarray(jax.grad(beta_prior)(transmittance))[0, 0]
    clear = np.float64(np.asarray(transmittance)[0, 0])
    np.testing.assert_allclose(gradient, (1 / clear - 1 / (1 - clear)) / 5, rtol=1e-5, atol=1e-6)
    # Descending, what is nearly clear becomes clear.
    assert gradient[0] > 0 > gradient[-1]


def test_gates_open_for_pictures_that_fit_and_close_at_their_target() -> None:
    clear, scores, target = jnp.full((1, 2, 2), 0.5), jnp.array([0.4]), jnp.array([0.6])
    by_score, by_clear = jax.grad(gated, argnums=(0, 1))(scores, clear)
    np.testing.assert_allclose(by_score, -0.5, rtol=1e-6)  # better pictures, less loss
    np.testing.assert_allclose(by_clear, -0.4 / 4, rtol=1e-6)  # clearer ones too, as long as they fit
    np.testing.assert_array_equal(jax.grad(clipped_gated, argnums=1)(scores, clear, target), by_clear)
    np.testing.assert_array_equal(jax.grad(clipped_gated, argnums=1)(scores, clear + 0.2, target), 0.0)

"""What changes over a dream, and what it minimises, against the paper's numbers and formulas."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import CameraConfig, LossConfig, OptimConfig
from dreamfields_core.dreaming.losses import clipped_transmittance, similarity
from dreamfields_core.dreaming.schedules import geometric, learning_rate, target_transmittance
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


def test_similarity_is_the_mean_cosine() -> None:
    rng = np.random.default_rng(0)
    images, text = rng.normal(size=(6, 5)), rng.normal(size=5)
    images, text = images / np.linalg.norm(images, axis=1, keepdims=True), text / np.linalg.norm(text)
    expected = sum(float(image @ text) for image in images) / 6
    assert float(similarity(jnp.asarray(images, jnp.float32), jnp.asarray(text, jnp.float32))) == pytest.approx(expected, abs=2e-7)

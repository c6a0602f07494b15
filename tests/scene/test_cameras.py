"""Cameras against a look-at matrix in float64, and the poses drawn in training."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import CameraConfig, Range
from dreamfields_core.scene.cameras import FOCAL_UNIT, Pose, camera_axes, camera_rays, poses_at, sample_poses
from tests import reference

ROUNDING = 2e-6
"""float32: the angle itself is off by up to 4e-7 at 2 pi, then some ten operations of 6e-8 each."""

rays_of = jax.jit(camera_rays, static_argnames="size")
axes_of = jax.jit(camera_axes)


def pose_of(azimuth: float, elevation: float, radius: float, focal: float) -> Pose:
    return Pose(*(jnp.float32(value) for value in (azimuth, elevation, radius, focal)))


@settings(max_examples=40)
@given(
    azimuth=st.floats(-7.0, 7.0),
    elevation=st.floats(-1.5, 1.5),
    radius=st.floats(0.1, 100.0),
    focal=st.floats(0.2, 8.0),
    origin=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
)
def test_rays_are_those_of_a_look_at_matrix(azimuth: float, elevation: float, radius: float, focal: float, origin: tuple) -> None:
    rays = rays_of(pose_of(azimuth, elevation, radius, focal), jnp.asarray(origin, jnp.float32), size=5)
    # The twin starts from the rounded angles: what is judged is the geometry, not the last digit of an input.
    exact = [float(np.float32(value)) for value in (azimuth, elevation, radius, focal)]
    origins, directions, radii = reference.look_at_rays(*exact, np.asarray(np.float32(origin), np.float64), 5)
    np.testing.assert_allclose(rays.origins, origins, rtol=0, atol=ROUNDING * (radius + 2.0))
    np.testing.assert_allclose(rays.directions, directions, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(rays.radii, radii, rtol=ROUNDING)


@settings(max_examples=20)
@given(azimuth=st.floats(0.0, 6.3), elevation=st.floats(-1.6, 1.6))
def test_directions_are_unit_vectors_and_the_axes_a_right_handed_frame(azimuth: float, elevation: float) -> None:
    pose = pose_of(azimuth, elevation, 4.0, 1.3)
    rays = rays_of(pose, jnp.zeros(3), size=5)
    np.testing.assert_allclose(np.linalg.norm(np.asarray(rays.directions, np.float64), axis=-1), 1.0, atol=3e-7)
    frame = np.stack([np.asarray(axis, np.float64) for axis in axes_of(pose)])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=3e-7)
    assert np.dot(np.cross(frame[0], frame[1]), frame[2]) == pytest.approx(-1.0, abs=1e-6)


def test_the_middle_pixel_looks_at_the_origin_from_its_radius() -> None:
    origin = jnp.array([0.3, -0.2, 0.1])
    rays = rays_of(poses_at([10.0, 100.0, 310.0], 25.0, radius=3.0, focal=1.1), origin, size=7)
    reached = np.asarray(rays.origins + 3.0 * rays.directions)[:, 3, 3]
    np.testing.assert_allclose(reached, np.broadcast_to(origin, reached.shape), atol=2e-6)


def test_row_0_is_at_the_top_and_column_0_on_the_left() -> None:
    rays = rays_of(pose_of(0.0, 0.0, 4.0, 1.0), jnp.zeros(3), size=4)
    directions = np.asarray(rays.directions)
    assert (directions[0, :, 2] > 0).all() and (directions[-1, :, 2] < 0).all()
    # Seen from +x toward the origin with z up, +y is on the right.
    assert (directions[:, 0, 1] < 0).all() and (directions[:, -1, 1] > 0).all()


@pytest.mark.parametrize("elevation", [90.0, -90.0])
def test_straight_down_and_up_have_an_upright_too(elevation: float) -> None:
    def straight(azimuth: jax.Array) -> jax.Array:
        pose = Pose(azimuth, jnp.deg2rad(jnp.float32(elevation)), jnp.float32(4.0), jnp.float32(1.0))
        return camera_rays(pose, jnp.zeros(3), size=4).directions

    values, slopes = jax.jvp(straight, (jnp.float32(0.7),), (jnp.ones(()),))
    assert np.isfinite(values).all() and np.isfinite(slopes).all()
    np.testing.assert_allclose(np.mean(values, axis=(0, 1))[:2], 0.0, atol=1e-6)
    assert np.sign(np.mean(values[..., 2])) == -np.sign(elevation)


def test_radii_are_mip_nerfs() -> None:
    # mip-NeRF: 2 / sqrt(12) of the distance between neighbouring pixels, which here is 1 / (size focal) on the plane at distance 1.
    rays = rays_of(pose_of(0.4, 0.5, 4.0, 1.5), jnp.zeros(3), size=201)
    middle = np.asarray(rays.directions, np.float64)[100]
    gap = np.linalg.norm(middle[101] / (middle[101] @ middle[100]) - middle[100])
    assert float(rays.radii[100, 100, 0]) == pytest.approx(gap * 2 / np.sqrt(12), rel=1e-3)


@pytest.mark.parametrize("shape", [(), (1,), (3,), (2, 3)])
def test_shapes(shape: tuple, size: int = 2) -> None:
    pose = jax.tree.map(lambda value: jnp.broadcast_to(value, shape), pose_of(0.1, 0.2, 4.0, 1.0))
    rays = rays_of(pose, jnp.zeros(3), size=size)
    assert rays.origins.shape == rays.directions.shape == (*shape, size, size, 3)
    assert rays.radii.shape == (*shape, size, size, 1)


def test_degrees_become_radians_once() -> None:
    pose = poses_at([0.0, 90.0], 30.0, radius=4.0, focal=FOCAL_UNIT)
    np.testing.assert_allclose(pose.azimuth, [0.0, np.pi / 2], rtol=1e-6)
    np.testing.assert_allclose(pose.elevation, [np.pi / 6] * 2, rtol=1e-6)
    np.testing.assert_allclose(pose.focal, [1.38888887] * 2, rtol=1e-6)


CAMERA = CameraConfig(
    azimuth=Range(low=20.0, high=340.0),
    elevation=Range(low=-10.0, high=60.0),
    radius=Range(low=3.0, high=5.0),
    focal=Range(low=1.0, high=2.0),
    views=3,
)
DRAWS = 4000


@pytest.fixture(scope="module")
def drawn() -> Pose:
    keys = jax.random.split(jax.random.key(0), DRAWS)
    return jax.tree.map(np.asarray, jax.jit(jax.vmap(lambda key: sample_poses(key, CAMERA)))(keys))


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("azimuth", *np.deg2rad([20, 340])), ("elevation", *np.deg2rad([-10, 60])), ("radius", 3.0, 5.0), ("focal", 1.0, 2.0)],
)
def test_every_view_alone_is_uniform_in_its_range(drawn: Pose, name: str, low: float, high: float) -> None:
    for view in range(CAMERA.views):
        values = getattr(drawn, name)[:, view]
        assert values.min() >= low - 1e-6 and values.max() <= high + 1e-6
        # Kolmogorov-Smirnov on a fixed seed; a range off by 5 % would give a p-value below 1e-6 at this sample.
        assert scipy.stats.kstest(values, "uniform", args=(low, high - low)).pvalue > 1e-3


def test_views_are_spread_evenly_over_the_range(drawn: Pose) -> None:
    share = (drawn.azimuth - np.deg2rad(20)) / np.deg2rad(320)
    for first in range(3):
        gap = (share[:, (first + 1) % 3] - share[:, first]) % 1.0
        # Neighbouring parts are a third wide: their samples are less than two thirds apart, a third on average.
        assert gap.max() < 2 / 3 + 1e-5
        assert gap.mean() == pytest.approx(1 / 3, abs=0.01)


def test_elevation_radius_and_focal_of_two_views_are_independent(drawn: Pose) -> None:
    for name in ("elevation", "radius", "focal"):
        values = getattr(drawn, name)
        # Standard error of a correlation of 4 000 pairs is 0.016.
        assert abs(np.corrcoef(values[:, 0], values[:, 1])[0, 1]) < 0.07
    assert abs(np.corrcoef(drawn.radius[:, 0], drawn.focal[:, 0])[0, 1]) < 0.07


def test_the_key_decides_the_poses() -> None:
    one, same, other = (sample_poses(jax.random.key(seed), CAMERA) for seed in (1, 1, 2))
    for name in ("azimuth", "elevation", "radius", "focal"):
        np.testing.assert_array_equal(getattr(one, name), getattr(same, name))
        assert (np.asarray(getattr(one, name)) != np.asarray(getattr(other, name))).all()


def test_a_range_of_one_value_is_that_value() -> None:
    pose = sample_poses(jax.random.key(3), CameraConfig(views=2))
    np.testing.assert_array_equal(pose.radius, [4.0, 4.0])
    np.testing.assert_allclose(np.rad2deg(pose.elevation), 30.0, rtol=1e-6)
    np.testing.assert_allclose(pose.focal, 1.2 * 1111.1111 / 800, rtol=1e-6)

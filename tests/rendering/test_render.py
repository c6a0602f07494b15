"""Rays through scenes with closed-form answers."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import HybridConfig, SkipConfig
from dreamfields_core.fields import Field, build_field
from dreamfields_core.rendering import images
from dreamfields_core.rendering.occupancy import refresh, unknown_occupancy
from dreamfields_core.rendering.render import Tally, render_rays
from dreamfields_core.scene.cameras import camera_rays, poses_at
from dreamfields_core.types import Rays, Rendering
from tests import reference
from tests.rendering.solids import COLOR, ball, parallel_rays

SIGMA, RADIUS = 1.5, 0.6
FIELD = ball(radius=RADIUS)
CENTER = jnp.zeros(3)
SIDE = 24
SKIP = SkipConfig(chunk=1024)


@functools.cache
def renderer(samples: int, field: Field = FIELD, skip: SkipConfig = SKIP) -> Callable:
    """(key, rays, density) -> Rendering, Tally; compiled once for all tests."""

    def render(key: jax.Array | None, rays: Rays, density: float) -> tuple[Rendering, Tally]:
        occupancy = unknown_occupancy(4)
        return render_rays(key, field, {"density": density}, rays, CENTER, occupancy, samples=samples, bound=1.0, skip=skip)

    return jax.jit(render)


def render(key: jax.Array | None, samples: int) -> tuple[Rendering, Tally]:
    return renderer(samples)(key, parallel_rays(SIDE), SIGMA)


def exact() -> np.ndarray:
    rays = parallel_rays(SIDE)
    return np.array(
        [
            reference.ball_transmittance(np.float64(start), np.float64(toward), RADIUS, SIGMA)
            for start, toward in zip(np.asarray(rays.origins), np.asarray(rays.directions), strict=True)
        ]
    )


def test_a_homogeneous_ball_converges_to_its_closed_form() -> None:
    truth, errors = exact(), []
    counts = (16, 64, 256)
    for samples in counts:
        rendering, _ = render(None, samples)
        transmittance = np.asarray(rendering.transmittance, np.float64)
        errors.append(float(np.sqrt(np.mean((transmittance - truth) ** 2))))
        # One sample more or less at either side: sigma x step of optical depth at the very most.
        assert np.abs(transmittance - truth).max() < SIGMA * 2 * 3**0.5 / samples
        # Of one colour throughout: colour is that colour times opacity.
        np.testing.assert_allclose(rendering.color, (1 - transmittance)[:, None] * np.array(COLOR), atol=2e-6)
    # A step edge is found to within a step: the error falls as 1 / samples. (Order measured: 1.02.)
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert 0.8 < order < 1.5, errors
    assert errors[-1] < 3e-3


def test_jittered_samples_see_the_ball_on_average() -> None:
    draws = np.stack([np.asarray(render(jax.random.key(seed), 16)[0].transmittance, np.float64) for seed in range(24)])
    error = draws.std(axis=0, ddof=1) / np.sqrt(len(draws))
    # exp is convex, so the mean transmittance lies above by half the variance of the optical depth: included in the bound.
    bias = 0.5 * draws.var(axis=0)
    assert (np.abs(draws.mean(axis=0) - exact()) <= 5 * error + 2 * bias + 1e-3).mean() > 0.97


def test_a_ray_that_misses_sees_only_the_background() -> None:
    starts, directions = jnp.array([[-4.0, 3.0, 0.0]] * 2), jnp.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rays = Rays(starts, directions, jnp.full((2, 1), 1e-3))
    rendering, tally = renderer(16)(jax.random.key(0), rays, 1e6)
    np.testing.assert_array_equal(rendering.transmittance, 1.0)
    np.testing.assert_array_equal(rendering.color, 0.0)
    np.testing.assert_array_equal(rendering.depth, 0.0)
    assert int(tally.evaluated) == 0 and int(tally.possible) == 32 and float(tally.mass) == 0.0


def test_depth_lies_within_the_ball() -> None:
    rendering, _ = render(None, 64)
    hit = exact() < 0.9
    depth = np.asarray(rendering.depth)[hit]
    assert (depth > 3 - RADIUS).all() and (depth < 3 + RADIUS).all()


def test_the_tally_finds_the_balls_centre() -> None:
    center = (0.3, -0.2, 0.1)
    _, tally = renderer(48, ball(radius=0.4, centers=(center,)))(None, parallel_rays(SIDE), 0.1)
    # A thin ball on a lattice of rays 0.075 and samples 0.072 apart.
    np.testing.assert_allclose(np.asarray(tally.moment) / float(tally.mass), center, atol=0.01)


def test_the_key_decides_the_picture() -> None:
    one, same, other = (np.asarray(render(jax.random.key(seed), 16)[0].color) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.any(one != other)


def test_gradient_in_the_density_is_that_of_the_formula() -> None:
    rays, truth = parallel_rays(SIDE), exact()
    # T = exp(-sigma chord), so dT / d sigma = T log(T) / sigma; the quadrature's own error is below 1 %.
    expected = np.mean(truth * np.log(truth)) / SIGMA
    slope = jax.jit(jax.grad(lambda density: jnp.mean(renderer(64)(None, rays, density)[0].transmittance)))
    assert float(slope(SIGMA)) == pytest.approx(expected, rel=2e-2)


@pytest.fixture(scope="module")
def settled() -> tuple:
    """A hybrid field as it starts, a soft ball, with a memory of many refreshes."""
    field = build_field(HybridConfig(resolutions=(4,), features=2, width=4, blob=1.0, empty=-9.0), bound=1.0)
    params = jax.jit(field.init)(jax.random.key(0))
    ask = jax.jit(lambda key, occupancy: refresh(key, occupancy, field, field.prepare(params), CENTER, bound=1.0, decay=0.95))
    occupancy = unknown_occupancy(16)
    for seed in range(12):
        occupancy = ask(jax.random.key(seed), occupancy)
    return field, params, occupancy


def test_skipping_leaves_the_picture_as_it_is(settled: tuple, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "BLOCK", 100)  # 144 rays: one block whole, one filled up
    field, params, occupancy = settled
    pose = jax.tree.map(lambda leaf: leaf[0], poses_at([30.0], 20.0, radius=4.0, focal=1.4))
    skip = SkipConfig(threshold=1e-3, chunk=512)
    views = [
        images.view_renderer(field, params, CENTER, occupancy, samples=48, bound=1.0, skip=setting)(pose, 12)
        for setting in (skip, skip.model_copy(update={"enabled": False}))
    ]
    # What counts as empty has at most threshold optical depth a sample, in at most 48 of them.
    for name in ("color", "transmittance"):
        np.testing.assert_allclose(getattr(views[0], name), getattr(views[1], name), atol=48e-3)
        assert np.abs(getattr(views[0], name) - getattr(views[1], name)).mean() < 5e-3
    assert views[0].color.shape == (12, 12, 3) and views[0].depth.shape == (12, 12)


def test_blocks_of_rays_make_one_picture(settled: tuple, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "BLOCK", 100)
    field, params, occupancy = settled
    pose = jax.tree.map(lambda leaf: leaf[0], poses_at([30.0], 20.0, radius=4.0, focal=1.4))
    skip = SkipConfig(enabled=False, chunk=512)
    view = images.view_renderer(field, params, CENTER, occupancy, samples=48, bound=1.0, skip=skip)(pose, 12)
    rays = jax.tree.map(lambda leaf: leaf.reshape(-1, leaf.shape[-1]), camera_rays(pose, CENTER, size=12))
    whole, _ = jax.jit(
        lambda rays: render_rays(None, field, field.prepare(params), rays, CENTER, occupancy, samples=48, bound=1.0, skip=skip)
    )(rays)
    np.testing.assert_allclose(view.color.reshape(-1, 3), whole.color, atol=1e-6)
    np.testing.assert_allclose(view.transmittance.reshape(-1), whole.transmittance, atol=1e-6)


def test_on_white() -> None:
    rendering = Rendering(color=np.array([[0.3, 0.2, 0.9]]), transmittance=np.array([0.5]), depth=np.zeros(1))
    np.testing.assert_allclose(images.on_white(rendering), [[0.8, 0.7, 1.0]])


@pytest.mark.parametrize("count", [0, 1])
def test_few_rays(count: int) -> None:
    rays = jax.tree.map(lambda leaf: leaf[:count], parallel_rays(1))

    def total(density: jax.Array) -> tuple:
        rendering, tally = renderer(16)(jax.random.key(0), rays, density)
        return jnp.sum(rendering.transmittance) + jnp.sum(rendering.color), (rendering, tally)

    gradient, (rendering, tally) = jax.jit(jax.grad(total, has_aux=True))(jnp.ones(()))
    assert np.isfinite(gradient) and rendering.color.shape == (count, 3) and int(tally.possible) == 16 * count

"""What comes in as bfloat16 or float16 is computed in float32: exactly the result of the same numbers, widened first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import HybridConfig, ResidualMLPConfig, SkipConfig
from dreamfields_core.dreaming.blur import gaussian_blur
from dreamfields_core.dreaming.losses import clipped_transmittance, cosines
from dreamfields_core.fields import build_field
from dreamfields_core.fields.encodings import integrated_encoding
from dreamfields_core.rendering.compositing import composite, optical_depths, transmittance_before, weights_of
from dreamfields_core.rendering.occupancy import refresh, unknown_occupancy
from dreamfields_core.rendering.packing import MOST, evaluate_packed
from dreamfields_core.rendering.render import render_rays
from dreamfields_core.rendering.sampling import place_samples
from dreamfields_core.scene.cameras import camera_rays, poses_at
from dreamfields_core.scene.cube import ray_cube
from dreamfields_core.scene.origin import track_origin
from dreamfields_core.types import Gaussians
from tests.stress.extremes import HALVES, as_rays, halved, rays_about, widened

RNG = np.random.default_rng(0)
RAYS = as_rays(*rays_about(1.0, 4.0))
POSES = poses_at([30.0, 200.0], 20.0, radius=4.0, focal=1.4)
FIELDS = {
    "hybrid": HybridConfig(resolutions=(2,), features=2, width=4),
    "residual_mlp": ResidualMLPConfig(frequencies=4, levels=3.0, width=8, bottleneck=8, blocks=1),
}


def uniform(*shape: int) -> jax.Array:
    return jnp.asarray(RNG.uniform(size=shape), jnp.float32)


def some_gaussians() -> Gaussians:
    means = uniform(5, 3)
    return Gaussians(means, means / jnp.linalg.norm(means, axis=1, keepdims=True), 0.1 * uniform(5), 0.01 * uniform(5))


EQUATIONS: dict[str, tuple[Callable, tuple]] = {
    "ray_cube": (lambda rays, origin: ray_cube(rays, origin, bound=1.0), (RAYS, jnp.array([0.1, 0.2, -0.3]))),
    "place_samples": (lambda rays, origin: place_samples(None, rays, origin, bound=1.0, count=6), (RAYS, jnp.zeros(3))),
    "camera_rays": (
        lambda pose, origin: camera_rays(pose, origin, size=3),
        (poses_at([30.0, 200.0], 20.0, radius=4.0, focal=1.4), jnp.ones(3)),
    ),
    "track_origin": (lambda *values: track_origin(*values, decay=0.9), (jnp.ones(3), jnp.float32(2.0), jnp.ones(3))),
    "optical_depths": (optical_depths, (jnp.array([0.0, 1e-3, 60000.0, jnp.inf]), jnp.array([0.1, 0.0, 7.0, 0.3]))),
    "transmittance_before": (transmittance_before, (uniform(3, 300),)),
    "weights_of": (weights_of, (uniform(3, 300),)),
    "composite": (composite, (uniform(2, 300), uniform(2, 300, 3), uniform(2, 300))),
    "integrated_encoding": (integrated_encoding, (20.0 * uniform(7, 3), some_gaussians())),
    "gaussian_blur": (gaussian_blur, (uniform(5, 5, 3), jnp.float32(1.3))),
    "cosines": (cosines, (uniform(4, 6), uniform(6))),
    "cosines, a caption each": (cosines, (uniform(4, 6), uniform(4, 6))),
    "clipped_transmittance": (clipped_transmittance, (uniform(2, 9, 9), uniform(2))),
}
"""Every equation of geometry, encoding, optical depth and loss, with arguments; a new one joins here."""


def assert_same(one: Any, other: Any) -> None:
    leaves, others = jax.tree.leaves(one), jax.tree.leaves(other)
    assert len(leaves) == len(others)
    for leaf, expected in zip(leaves, others, strict=True):
        assert leaf.dtype == expected.dtype and leaf.dtype.itemsize >= 4
        np.testing.assert_array_equal(leaf, expected)


@pytest.mark.parametrize("half", HALVES, ids=lambda half: half.__name__)
@pytest.mark.parametrize("name", EQUATIONS)
def test_equations(name: str, half: Any) -> None:
    equation, arguments = EQUATIONS[name]
    narrow = halved(arguments, half)
    assert_same(jax.jit(equation)(*narrow), jax.jit(equation)(*widened(narrow)))


@pytest.mark.parametrize("half", HALVES, ids=lambda half: half.__name__)
@pytest.mark.parametrize("name", FIELDS)
def test_a_rendering_with_half_precision_rays_and_parameters(name: str, half: Any) -> None:
    field = build_field(FIELDS[name], bound=1.0)
    params = field.init(jax.random.key(0))

    def loss(params: Any, rays: Any) -> tuple[jax.Array, Any]:
        skip = SkipConfig(resolution=2, chunk=64)
        rendering, tally = render_rays(
            jax.random.key(1), field, field.prepare(params), rays, jnp.zeros(3), unknown_occupancy(2), samples=5, bound=1.0, skip=skip
        )
        return jnp.sum(rendering.color) + jnp.sum(rendering.transmittance), (rendering, tally)

    narrow = halved((params, RAYS), half)
    run = jax.jit(jax.grad(loss, has_aux=True))
    gradient, seen = run(*narrow)
    wide_gradient, expected = run(*widened(narrow))
    for one, other in zip(jax.tree.leaves(seen), jax.tree.leaves(expected), strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_allclose(one, other, atol=2e-6, rtol=2e-6)
    # The gradient has its parameter's own type: in each chunk factors and sum are rounded to it (bfloat16 keeps 8 bits), across
    # chunks nothing is.
    for one, other in zip(jax.tree.leaves(gradient), jax.tree.leaves(wide_gradient), strict=True):
        assert one.dtype == half
        np.testing.assert_allclose(np.float32(one), other, atol=2**-7 * np.abs(other).max() + 1e-5)


@pytest.mark.parametrize("half", HALVES, ids=lambda half: half.__name__)
def test_a_field_that_computes_in_half_precision_is_packed_and_added_up_in_float32(half: Any) -> None:
    count = 3000
    points = jnp.ones((count, 3))

    def at(samples: jax.Array, index: jax.Array) -> Gaussians:
        return Gaussians(samples[index], samples[index], samples[index, 0], samples[index, 0])

    def apply(params: jax.Array, gaussians: Gaussians) -> tuple[jax.Array, jax.Array]:
        raw = gaussians.means[:, 0].astype(half) * params
        return raw, jnp.stack([raw] * 3, axis=1)

    def total(params: jax.Array) -> tuple[jax.Array, Any]:
        raw, color = evaluate_packed(apply, at, 1, params, points, jnp.arange(count) % 2 == 0)
        return jnp.sum(raw), (raw, color)

    gradient, (raw, color) = jax.jit(jax.grad(total, has_aux=True))(jnp.asarray(1.5, half))
    assert raw.dtype == color.dtype == jnp.float32 and gradient.dtype == half
    np.testing.assert_array_equal(raw, np.where(np.arange(count) % 2 == 0, 1.5, 0.0))
    # 1 500 chunks of 1 each: in bfloat16 the sum would stop at 256, in float16 it is exact.
    assert float(gradient) == pytest.approx(count / 2, rel=2**-8)


def test_a_memory_of_a_half_precision_field_is_float32() -> None:
    field = build_field(FIELDS["hybrid"], bound=1.0)
    prepared = halved(field.prepare(field.init(jax.random.key(0))), jnp.bfloat16)
    found = refresh(jax.random.key(0), unknown_occupancy(3), field, prepared, jnp.zeros(3), bound=1.0, decay=0.9)
    assert found.density.dtype == jnp.float32 and np.isfinite(found.density).all()


def test_more_samples_than_can_be_numbered_are_refused() -> None:
    mask = jax.ShapeDtypeStruct((MOST + 1,), bool)
    with pytest.raises(ValueError, match=r"expected at most 2147483647 samples at once, got 2147483648: render fewer rays"):
        jax.eval_shape(lambda mask: evaluate_packed(lambda params, at: at, lambda samples, index: index, 64, {}, {}, mask), mask)

"""Every kind of field learns a picture: a red disc on white, by the optimiser and the renderer that dreams have."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from dreamfields_core.config import (
    FieldConfig,
    HybridConfig,
    ImagePlaneConfig,
    NeRFMLPConfig,
    ResidualMLPConfig,
    SignedDistanceConfig,
    SkipConfig,
    VoxelGridConfig,
)
from dreamfields_core.fields import build_field
from dreamfields_core.rendering.compositing import over
from dreamfields_core.rendering.occupancy import unknown_occupancy
from dreamfields_core.rendering.render import render_rays
from dreamfields_core.scene.cameras import camera_rays, poses_at
from dreamfields_core.types import Array, Params

pytestmark = pytest.mark.slow

SIZE, STEPS = 12, 60
NETWORK = {"frequencies": 8, "levels": 3, "width": 16}
KINDS: dict[str, tuple[FieldConfig, float]] = {
    "nerf_mlp": (NeRFMLPConfig(levels=3, width=24, depth=3), 1e-2),
    "residual_mlp": (ResidualMLPConfig(**NETWORK, bottleneck=16, blocks=1), 1e-2),
    "residual_mlp, neither integrated nor random": (
        ResidualMLPConfig(**NETWORK, fourier=False, integrated=False, bottleneck=16, blocks=1),
        1e-2,
    ),
    "hybrid": (HybridConfig(resolutions=(3, 6), features=4, width=8), 3e-2),
    "voxel_grid": (VoxelGridConfig(resolution=10, density_scale=20.0), 0.1),
    "signed_distance": (SignedDistanceConfig(**NETWORK, bottleneck=16, blocks=1, radius=0.2, eikonal_points=64), 1e-2),
    "image_plane": (ImagePlaneConfig(resolution=SIZE, thickness=0.15, spread=0.0), 0.1),
}
"""Settings and a rate for each."""


def disc() -> tuple[np.ndarray, np.ndarray]:
    """[SIZE, SIZE, 3] colours on white and [SIZE, SIZE] transmittance."""
    places = (np.arange(SIZE) + 0.5) / SIZE - 0.5
    inside = np.hypot(*np.meshgrid(places, places)) < 0.28
    return np.where(inside[..., None], [0.9, 0.1, 0.1], 1.0), 1.0 - inside


@pytest.mark.parametrize("name", KINDS)
def test_it_learns_a_disc_and_the_emptiness_around_it(name: str) -> None:
    config, rate = KINDS[name]
    field = build_field(config, bound=1.2)
    rays = camera_rays(poses_at([0.0], 30.0, radius=4.0, focal=1.2 * 1111.1111 / 800), jnp.zeros(3), size=SIZE)
    flat = jax.tree.map(lambda leaf: leaf.reshape(-1, leaf.shape[-1]), rays)
    picture, clear = (jnp.asarray(value, jnp.float32) for value in disc())
    adam = optax.adam(rate)

    def loss_of(params: Params, key: Array) -> tuple[Array, Array]:
        prepared = field.prepare(params)
        seen, _ = render_rays(
            key, field, prepared, flat, jnp.zeros(3), unknown_occupancy(2), samples=32, bound=1.2, skip=SkipConfig(enabled=False)
        )
        shown = over(seen, jnp.ones((SIZE**2, 3))).reshape(SIZE, SIZE, 3)
        error = jnp.mean((shown - picture) ** 2) + jnp.mean((seen.transmittance.reshape(SIZE, SIZE) - clear) ** 2)
        return error + 0.1 * field.penalty(key, prepared), error

    @jax.jit
    def step(params: Params, state: Params, key: Array) -> tuple[Params, Params, Array]:
        (_, error), gradient = jax.value_and_grad(loss_of, has_aux=True)(params, key)
        change, state = adam.update(gradient, state, params)
        return optax.apply_updates(params, change), state, error

    params = field.init(jax.random.key(0))
    state, errors = adam.init(params), []
    for number in range(STEPS):
        params, state, error = step(params, state, jax.random.key(number))
        errors.append(float(error))
    assert np.isfinite(errors).all()
    # A mean picture has an error of about 0.3; what is left is a disc with soft edges.
    assert np.mean(errors[-5:]) < min(0.12, 0.5 * errors[0]), (errors[0], errors[-5:])

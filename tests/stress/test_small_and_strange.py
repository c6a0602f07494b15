"""One pixel, one sample, one cell, no blur, no ray; fields that are infinite or not numbers; points a universe away."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import AugmentConfig, ConfigError, SkipConfig, validate
from dreamfields_core.dreaming.augmentations import augmented_copies
from dreamfields_core.dreaming.blur import blur_matrix, gaussian_blur
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.guidance.resize import resize
from dreamfields_core.rendering.images import view_renderer
from dreamfields_core.rendering.occupancy import DENSEST, Occupancy, cell_index, occupied_cells, refresh, unknown_occupancy
from dreamfields_core.scene.cameras import camera_rays, poses_at
from dreamfields_core.types import Rendering
from tests import reference
from tests.dreaming.test_program import ENCODER, TEXT, config_of
from tests.stress.extremes import medium

NOWHERE = jnp.zeros(3)


def views(size: int, transmittance: float) -> Rendering:
    clear = jnp.full((1, size, size), transmittance)
    return Rendering(
        color=jnp.full((1, size, size, 3), 0.5) * (1.0 - clear[..., None]), transmittance=clear, depth=jnp.zeros((1, size, size))
    )


@pytest.mark.parametrize("blur", [0.0, 10.0])
@pytest.mark.parametrize("kind", ["noise", "checkerboard", "fourier", "solid", "white"])
def test_one_pixel_on_every_background(kind: str, blur: float) -> None:
    augment = AugmentConfig(backgrounds=(kind,), blur=blur, copies=2)

    def total(seen: Rendering) -> tuple[jax.Array, jax.Array]:
        copies = augmented_copies(jax.random.key(0), seen, augment=augment, crop=1)
        return jnp.sum(copies), copies

    for transmittance in (0.0, 1.0):
        slope, copies = jax.grad(total, has_aux=True)(views(1, transmittance))
        assert copies.shape == (2, 1, 1, 3) and ((np.asarray(copies) >= 0) & (np.asarray(copies) <= 1)).all()
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))
    assert np.isfinite(resize(copies, 8)).all()


@pytest.mark.parametrize("deviation", [0.0, 1e-30, 1e-4, 1e-3, 0.1, 1e30])
def test_any_width_of_blur(deviation: float) -> None:
    picture = np.random.default_rng(0).uniform(size=(9, 9, 2))
    ours = gaussian_blur(jnp.asarray(picture, jnp.float32), jnp.float32(deviation))
    # Below a thousandth of a pixel nothing is blurred; a neighbour's weight there is below exp(-500 000).
    np.testing.assert_allclose(ours, reference.blur(picture, deviation, 7), atol=1e-6)
    slope = jax.grad(lambda width: jnp.sum(blur_matrix(9, width)[0] ** 2))(jnp.float32(deviation))
    assert np.isfinite(slope)


@pytest.mark.parametrize("settings", [{}, {"enabled": False}])
def test_a_picture_of_one_pixel_in_one_sample_of_one_cell(settings: dict) -> None:
    poses = poses_at([0.0, 90.0], 90.0, radius=4.0, focal=1.4)
    skip = SkipConfig(resolution=1, chunk=1, **settings)
    occupancy = Occupancy(density=jnp.full((1, 1, 1), 2.0), known=jnp.ones((), bool))
    raw = float(np.log(np.expm1(0.5)))
    see = view_renderer(medium(), {"raw": raw}, NOWHERE, occupancy, samples=1, bound=1.0, skip=skip)
    for view in range(2):
        seen = see(jax.tree.map(lambda leaf, view=view: leaf[view], poses), 1)
        # Straight down through the middle: a chord of 2, which is one piece of the diagonal's 3.46.
        np.testing.assert_allclose(seen.transmittance, np.exp(-0.5 * 2.0), rtol=1e-6)
        assert seen.color.shape == (1, 1, 3) and np.isfinite(seen.depth).all()


@pytest.mark.parametrize("raw", [np.inf, np.nan, 3e38])
def test_a_field_that_is_no_number_is_remembered_for_a_while_and_not_for_ever(raw: float) -> None:
    def ask(occupancy: Occupancy, raw: float) -> Occupancy:
        return refresh(jax.random.key(0), occupancy, medium(density_scale=20.0), {"raw": jnp.float32(raw)}, NOWHERE, bound=1.0, decay=0.9)

    ask = jax.jit(ask)  # type: ignore[assignment]
    occupancy = ask(unknown_occupancy(3), raw)
    np.testing.assert_array_equal(occupancy.density, DENSEST)
    assert np.all(occupied_cells(occupancy, step=0.01, threshold=1e-3))
    for _ in range(180):
        occupancy = ask(occupancy, -100.0)
    # 1e6 x 0.9^180 = 6e-3 a unit of length.
    assert not np.any(occupied_cells(occupancy, step=0.01, threshold=1e-3))


def test_points_a_universe_away_take_the_nearest_cell() -> None:
    points = jnp.asarray([[1e30, -1e30, 0.0], [np.inf, -np.inf, 0.99], [3e9, 1e-38, -3e9]], jnp.float32)
    cells = np.unravel_index(np.asarray(cell_index(points, NOWHERE, bound=1.0, resolution=4)), (4, 4, 4))
    np.testing.assert_array_equal(np.stack(cells, axis=1), [[3, 0, 2], [3, 0, 3], [3, 2, 0]])


@pytest.mark.parametrize("elevation", [-90.0, 0.0, 90.0])
@pytest.mark.parametrize("radius", [1e-8, 1.0, 1e4])
def test_cameras_anywhere_give_unit_directions(elevation: float, radius: float) -> None:
    rays = camera_rays(poses_at([0.0, 90.0, 359.999], elevation, radius=radius, focal=1.4), jnp.ones(3), size=3)
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=-1), 1.0, atol=3e-7)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(rays))


NONE_AT_ALL = ("camera.views", "augment.copies", "render.size", "render.crop", "render.samples", "render.skip.chunk", "render.devices")


@pytest.mark.parametrize("setting", NONE_AT_ALL)
def test_none_at_all_is_refused(setting: str) -> None:
    *path, last = setting.split(".")
    values: dict = {last: 0}
    for name in reversed(path):
        values = {name: values}
    with pytest.raises(ConfigError, match=rf"^{setting}: input should be greater than or equal to 1, got 0"):
        validate(values)


@pytest.mark.slow
@pytest.mark.parametrize("field", ["hybrid", "residual_mlp"])
def test_a_dream_of_one_pixel(field: str) -> None:
    skip = {"warmup_steps": 1, "refresh_every": 1, "resolution": 1, "chunk": 1}
    smallest = config_of(
        field,
        camera={"views": 1},
        render={"size": 1, "crop": 1, "samples": 1, "skip": skip},
        augment={"copies": 1, "blur": 0.0, "checkers": 1},
    )
    program = DreamProgram(smallest, ENCODER)
    state = program.start()
    for _ in range(4):
        state, metrics = program.step(state, TEXT)
        assert all(np.isfinite(value) for value in metrics.values()) and int(metrics["bad"]) == 0
    assert program.preview(state).shape == (1, 1, 3)

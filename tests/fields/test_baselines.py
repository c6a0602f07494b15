"""What makes the paper's baselines what they are: their sizes, their opacities, and what their cameras see of them."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import HybridConfig, ImagePlaneConfig, NeRFMLPConfig, VoxelGridConfig
from dreamfields_core.fields import build_field
from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.fields.grids import read_grid, total_variation
from dreamfields_core.fields.perturbed import perturb, perturbed
from dreamfields_core.scene.cameras import camera_rays, poses_at
from tests import reference
from tests.fields import twins


def size_of(config: NeRFMLPConfig | VoxelGridConfig) -> int:
    shapes = jax.eval_shape(build_field(config, bound=1.0).init, jax.random.key(0))
    held = [leaf.size for path, leaf in jax.tree_util.tree_flatten_with_path(shapes)[0] if "frequencies" not in str(path)]
    return sum(held)


def test_the_plain_network_has_the_494_thousand_numbers_that_the_paper_counts() -> None:
    assert size_of(NeRFMLPConfig(levels=10)) == 494_084


def test_the_voxel_grid_stores_four_numbers_at_each_of_its_vertices() -> None:
    assert size_of(VoxelGridConfig()) == 128**3 * 4


def test_a_new_voxel_grid_is_even_and_a_sample_of_the_papers_has_the_opacity_that_it_stores() -> None:
    field = build_field(VoxelGridConfig(resolution=3), bound=1.0)
    raw, colors = field.apply(field.init(jax.random.key(0)), points_as_gaussians(jnp.asarray([[0.3, -0.2, 0.9], [2.0, 0.0, 0.0]])))
    step = 2 * np.sqrt(3) / 192
    np.testing.assert_allclose(-np.expm1(-np.asarray(field.density(raw), np.float64) * step), 1 / (1 + np.exp(4)), rtol=1e-5)
    np.testing.assert_allclose(colors, 0.5)


def test_pictures_are_read_and_are_rough_as_grids_are() -> None:
    picture = np.random.default_rng(0).normal(size=(4, 4, 2)).astype(np.float32)
    points = np.random.default_rng(1).uniform(-2.5, 2.5, (30, 2)).astype(np.float32)
    twin = [twins.read_picture(np.float64(picture), np.float64(point), 2.0) for point in points]
    np.testing.assert_allclose(read_grid(jnp.asarray(picture), jnp.asarray(points), bound=2.0), twin, atol=5e-6)
    rough = sum(float(np.mean(np.diff(np.float64(picture), axis=axis) ** 2)) for axis in (0, 1))
    assert float(total_variation(jnp.asarray(picture))) == pytest.approx(rough, rel=1e-5)


@pytest.mark.parametrize("thickness", [0.02, 0.2])
def test_its_camera_sees_the_picture_whatever_the_thickness_of_its_sheet(thickness: float) -> None:
    focal, size = 1.6, 6
    config = ImagePlaneConfig(
        azimuth=70.0, elevation=25.0, radius=4.0, resolution=size, extent=2.0 / focal, thickness=thickness, spread=1.0
    )
    field = build_field(config, bound=3.0)
    params = field.init(jax.random.key(0))
    rays = camera_rays(poses_at([70.0], 25.0, radius=4.0, focal=focal), jnp.zeros(3), size=size)
    start, toward = (np.asarray(leaf).reshape(-1, 3) for leaf in (rays.origins, rays.directions))
    reach = np.linspace(2.0, 6.0, 4001)
    points = start[:, None] + (reach[:, None] * toward[:, None])
    raw, colors = jax.jit(field.apply)(params, points_as_gaussians(jnp.asarray(points.reshape(-1, 3), jnp.float32)))
    density = np.asarray(field.density(raw), np.float64).reshape(len(start), -1)
    opacity = 1.0 - np.exp(-density.sum(axis=1) * (reach[1] - reach[0]))
    centers = ((np.arange(size) + 0.5) / size - 0.5) * 2 * config.extent
    right, up = np.meshgrid(centers, -centers, indexing="xy")
    pixels = np.stack([right.ravel(), up.ravel()], axis=1)
    picture = np.asarray(params["picture"], np.float64)
    expected = np.array([twins.read_picture(picture, pixel, config.extent) for pixel in pixels])
    np.testing.assert_allclose(opacity, reference.sigmoid(expected[:, 0]), atol=2e-4)
    # Along a ray all of the sheet has one colour: the picture is seen in perspective.
    in_sheet = np.abs(reach - 4.05) < 0.05
    seen = np.asarray(colors).reshape(len(start), -1, 3)[:, in_sheet]
    np.testing.assert_allclose(seen, np.broadcast_to(reference.sigmoid(expected[:, None, 1:]), seen.shape), atol=2e-3)


def test_beyond_the_pictures_edge_and_behind_its_camera_there_is_nothing() -> None:
    config = ImagePlaneConfig(azimuth=0.0, elevation=0.0, extent=0.5, resolution=3, empty=5.0)
    field = build_field(config, bound=1.0)
    points = jnp.asarray([[0.0, 0.0, 0.0], [0.0, 0.49, 0.49], [0.0, 0.6, 0.0], [0.0, 0.0, -0.6], [4.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    raw, _ = field.apply(field.init(jax.random.key(0)), points_as_gaussians(points))
    density = np.asarray(field.density(raw))
    assert (density[:2] > 10).all() and (density[2:] == 0).all() and np.isfinite(raw).all()


BLOB = build_field(HybridConfig(resolutions=(2,), depth=0), bound=1.0)


def test_perturbed_density_is_normal_anew_at_every_point_and_colours_stay() -> None:
    params = BLOB.prepare(BLOB.init(jax.random.key(0)))
    points = points_as_gaussians(jax.random.uniform(jax.random.key(1), (20_000, 3), minval=-1.0, maxval=1.0))
    raw, colors = BLOB.apply(params, points)
    apply = jax.jit(perturbed(BLOB).apply)
    noisy, same = apply(perturb(jax.random.key(2), params, jnp.float32(0.5)), points)
    noise = (np.asarray(noisy) - np.asarray(raw)) / 0.5
    # Standard errors 0.007 and 0.005.
    assert abs(noise.mean()) < 0.03 and noise.std() == pytest.approx(1.0, abs=0.02)
    assert abs(np.corrcoef(noise[:-1], noise[1:])[0, 1]) < 0.03
    np.testing.assert_allclose(same, colors, atol=2e-7)
    again, _ = apply(perturb(jax.random.key(2), params, jnp.float32(0.5)), points)
    other, _ = apply(perturb(jax.random.key(3), params, jnp.float32(0.5)), points)
    np.testing.assert_array_equal(again, noisy)
    assert (np.asarray(other) != np.asarray(noisy)).mean() > 0.99
    np.testing.assert_allclose(apply(perturb(jax.random.key(2), params, jnp.float32(0.0)), points)[0], raw, atol=2e-6)


def test_the_gradient_of_a_perturbed_field_is_that_of_the_field() -> None:
    params = BLOB.init(jax.random.key(0))
    points = points_as_gaussians(jnp.asarray([[0.1, 0.2, -0.3], [0.5, 0.0, 0.4]]))

    def summed(params: dict, field: object, deviation: float | None) -> jax.Array:
        prepared = BLOB.prepare(params)
        read = prepared if deviation is None else perturb(jax.random.key(0), prepared, jnp.float32(deviation))
        return jnp.sum(field.apply(read, points)[0])  # type: ignore[attr-defined]

    plain, disturbed = jax.grad(summed)(params, BLOB, None), jax.grad(summed)(params, perturbed(BLOB), 2.0)
    jax.tree.map(np.testing.assert_array_equal, plain, disturbed)

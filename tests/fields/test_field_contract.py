"""What every field promises, whatever it is made of, and each field against its twin written out in float64."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import (
    FieldConfig,
    HybridConfig,
    ImagePlaneConfig,
    NeRFMLPConfig,
    ResidualMLPConfig,
    SignedDistanceConfig,
    VoxelGridConfig,
)
from dreamfields_core.fields import Field, build_field
from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.fields.grids import total_variation
from dreamfields_core.types import Gaussians
from tests import reference
from tests.fields import twins

BOUND = 1.25
KINDS: dict[str, FieldConfig] = {
    "residual_mlp": ResidualMLPConfig(frequencies=4, levels=3.0, width=8, bottleneck=12, blocks=2),
    "residual_mlp along the axes": ResidualMLPConfig(fourier=False, levels=2, width=6, bottleneck=8, blocks=1),
    "residual_mlp at points": ResidualMLPConfig(frequencies=3, levels=3.0, integrated=False, width=6, bottleneck=8, blocks=1),
    "nerf_mlp": NeRFMLPConfig(levels=2, width=10, depth=4),
    "nerf_mlp, integrated": NeRFMLPConfig(fourier=True, frequencies=3, integrated=True, levels=2.5, width=8, depth=1),
    "signed_distance": SignedDistanceConfig(frequencies=4, levels=2.0, width=6, bottleneck=8, blocks=1, eikonal_points=8),
    "voxel_grid": VoxelGridConfig(resolution=4, spread=0.5, density_scale=20.0),
    "image_plane": ImagePlaneConfig(azimuth=40.0, resolution=5, extent=0.9, thickness=0.5, spread=0.5),
    "hybrid": HybridConfig(resolutions=(3, 2), features=2, width=4, depth=2, spread=0.5),
    "hybrid, no network": HybridConfig(resolutions=(2, 4), depth=0, spread=0.5),
}


class Kind:
    """A field with its parameters, compiled once."""

    def __init__(self, name: str) -> None:
        self.name, self.config = name, KINDS[name]
        self.field: Field = build_field(self.config, bound=BOUND)
        self.init = jax.jit(self.field.init)
        self.params = self.init(jax.random.key(0))
        self.apply = jax.jit(lambda params, gaussians: self.field.apply(self.field.prepare(params), gaussians))

    def twin(self, params: dict, gaussians: Gaussians) -> np.ndarray:
        """[N, 4]."""
        rows = []
        for mean, direction, along, across in zip(*(np.asarray(leaf, np.float64) for leaf in jax.tree.leaves(gaussians)), strict=True):
            rows.append(self.twin_of_one(params, mean, reference.covariance(direction, along, across)))
        return np.array(rows)

    def twin_of_one(self, params: dict, mean: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        match self.config:
            case HybridConfig():
                return reference.hybrid(params, mean, self.config, BOUND)
            case VoxelGridConfig():
                return twins.voxel_grid(params, mean, BOUND)
            case ImagePlaneConfig():
                return twins.image_plane(params, mean, self.config)
            case SignedDistanceConfig():
                return twins.signed_distance(params, mean, matrix, self.config.radius)
        encoded = reference.encoding(params["frequencies"], mean, matrix if self.config.integrated else 0.0 * matrix)
        if isinstance(self.config, NeRFMLPConfig):
            return twins.nerf_mlp(params, encoded, self.config.depth)
        return reference.residual_mlp(params, encoded)


@pytest.fixture(scope="module", params=KINDS)
def kind(request: pytest.FixtureRequest) -> Kind:
    return Kind(request.param)


def some_gaussians(count: int, seed: int = 0) -> Gaussians:
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = rng.uniform(-BOUND, BOUND, (count, 3)), directions, rng.uniform(0, 0.1, count), rng.uniform(0, 0.01, count)
    return Gaussians(*(jnp.asarray(value, jnp.float32) for value in values))


def doubles(params: dict) -> dict:
    return jax.tree.map(lambda leaf: np.asarray(leaf, np.float64), params)


def test_against_its_twin(kind: Kind) -> None:
    gaussians = some_gaussians(12)
    raw, colors = kind.apply(kind.params, gaussians)
    twin = kind.twin(doubles(kind.params), gaussians)
    # A few layers of sums of some ten products near 1 each.
    np.testing.assert_allclose(raw, twin[:, 0], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(colors, twin[:, 1:], atol=5e-6)


def test_gradient_in_the_parameters_against_finite_differences(kind: Kind) -> None:
    """Through `prepare` and `apply`, along random directions in each array of parameters."""
    gaussians = some_gaussians(5, seed=1)
    rng = np.random.default_rng(2)
    mix = rng.normal(size=(5, 4))

    def ours(params: dict) -> jax.Array:
        raw, colors = kind.field.apply(kind.field.prepare(params), gaussians)
        return jnp.sum(jnp.asarray(mix, jnp.float32) * jnp.concatenate([raw[:, None], colors], axis=1))

    gradient = jax.jit(jax.grad(ours))(kind.params)
    exact = doubles(kind.params)
    leaves, tree = jax.tree.flatten(exact)
    names = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_flatten_with_path(exact)[0]]
    for number, (name, slope) in enumerate(zip(names, jax.tree.leaves(gradient), strict=True)):
        if "frequencies" in name:  # they stay as drawn (paper section 3.1)
            np.testing.assert_array_equal(slope, 0.0)
            continue
        toward = rng.normal(size=leaves[number].shape)

        def moved(share: np.ndarray, number: int = number, toward: np.ndarray = toward) -> float:
            changed = [leaf + share * toward if place == number else leaf for place, leaf in enumerate(leaves)]
            return float(np.sum(mix * kind.twin(jax.tree.unflatten(tree, changed), gaussians)))

        expected = reference.slope(moved, np.zeros(()), np.ones(()))
        size = np.linalg.norm(slope) * np.linalg.norm(toward)
        assert float(np.sum(np.asarray(slope, np.float64) * toward)) == pytest.approx(expected, abs=2e-5 * size + 1e-6), name


@pytest.mark.parametrize("count", [0, 1, 7])
def test_shapes_and_ranges(kind: Kind, count: int) -> None:
    raw, colors = kind.apply(kind.params, some_gaussians(count))
    assert raw.shape == (count,) and colors.shape == (count, 3)
    assert raw.dtype == colors.dtype == jnp.float32
    assert (np.asarray(colors) >= 0).all() and (np.asarray(colors) <= 1).all()
    assert (np.asarray(kind.field.density(raw)) >= 0).all()


def test_far_away_and_without_extent_nothing_breaks(kind: Kind) -> None:
    points = jnp.asarray([[1e4, -1e4, 1e4], [0.0, 0.0, 0.0], [BOUND] * 3, [1e-30] * 3], jnp.float32)
    raw, colors = kind.apply(kind.params, _padded(points))
    assert np.isfinite(raw).all() and np.isfinite(colors).all()


def _padded(points: jax.Array) -> Gaussians:
    """Seven Gaussians, a size that is compiled already."""
    return points_as_gaussians(jnp.concatenate([points, jnp.zeros((7 - len(points), 3))]))


def test_init_is_decided_by_its_key(kind: Kind) -> None:
    other = kind.init(jax.random.key(1))
    for (path, one), same, different in zip(
        jax.tree_util.tree_flatten_with_path(kind.params)[0],
        jax.tree.leaves(kind.init(jax.random.key(0))),
        jax.tree.leaves(other),
        strict=True,
    ):
        np.testing.assert_array_equal(one, same)
        fixed = ("['bias']", "['scale']", "['log_beta']") + ("['frequencies']",) * (not getattr(kind.config, "fourier", True))
        if not jax.tree_util.keystr(path).endswith(fixed):
            assert (np.asarray(one) != np.asarray(different)).any(), path


def test_penalty_is_a_number_of_its_own_weight(kind: Kind) -> None:
    key = jax.random.key(3)
    penalty = float(jax.jit(lambda params: kind.field.penalty(key, kind.field.prepare(params)))(kind.params))
    if isinstance(kind.config, HybridConfig):
        grids = doubles(kind.params)["grids"]
        finest = max(kind.config.resolutions)
        whole = sum(kind.config.falloff**n * reference.resample(grids[f"grid{g}"], finest) for n, g in enumerate(kind.config.resolutions))
        assert penalty == pytest.approx(kind.config.smoothness * reference.total_variation(whole), rel=1e-5)
    elif isinstance(kind.config, VoxelGridConfig):
        grid = doubles(kind.params)["grid"][..., :1]
        assert penalty == pytest.approx(kind.config.smoothness * reference.total_variation(grid), rel=1e-5)
    elif isinstance(kind.config, ImagePlaneConfig):
        picture = doubles(kind.params)["picture"]
        rough = sum(float(np.mean(np.diff(picture, axis=axis) ** 2)) for axis in (0, 1))
        assert penalty == pytest.approx(kind.config.smoothness * rough, rel=1e-5)
    elif isinstance(kind.config, SignedDistanceConfig):
        points = jax.random.uniform(key, (8, 3), minval=-BOUND, maxval=BOUND)
        network = doubles(kind.params)["network"]

        def away(point: np.ndarray) -> float:
            return twins.distance(network, point, np.zeros((3, 3)), kind.config.radius, integrated=True)[0]

        slopes = [[reference.slope(away, np.float64(point), axis) for axis in np.eye(3)] for point in points]
        expected = np.mean((np.linalg.norm(slopes, axis=1) - 1.0) ** 2)
        assert penalty == pytest.approx(kind.config.eikonal * expected, rel=1e-4)
    else:
        assert penalty == 0.0


SCALES = {1.0: build_field(KINDS["residual_mlp"], bound=1.0), 20.0: build_field(KINDS["hybrid"], bound=1.0)}


@settings(max_examples=60)
@given(exponent=st.floats(-6, 6), scale=st.sampled_from(sorted(SCALES)))
def test_raw_is_the_inverse_of_density(exponent: float, scale: float) -> None:
    field, wanted = SCALES[scale], 10.0**exponent
    assert field.density_scale == scale
    # Raw goes to -17 at the small end, where rounding it by 1e-6 changes density by that share.
    assert float(field.density(jnp.float32(field.raw(wanted)))) == pytest.approx(wanted, rel=5e-6)


@pytest.mark.parametrize("scale", SCALES)
def test_density_of_any_raw_value_and_its_slope(scale: float) -> None:
    raw = np.float32([-1e30, -100.0, -20.0, -1.0, 0.0, 1.0, 20.0, 100.0, 1e30])
    density, slope = jax.vmap(jax.value_and_grad(SCALES[scale].density))(jnp.asarray(raw))
    # Below 1e-37 a float32 may be flushed to zero.
    np.testing.assert_allclose(density, scale * reference.softplus(np.float64(raw)), rtol=2e-6, atol=1e-37)
    np.testing.assert_allclose(slope, scale * 1 / (1 + np.exp(-np.float64(np.clip(raw, -700, 700)))), rtol=2e-6, atol=1e-37)


def test_the_papers_network_has_its_315_396_numbers() -> None:
    shapes = jax.eval_shape(build_field(ResidualMLPConfig(), bound=1.0).init, jax.random.key(0))
    assert sum(leaf.size for leaf in jax.tree.leaves(shapes)) == 315_396


def test_a_new_hybrid_is_a_ball_in_emptiness() -> None:
    config = HybridConfig(resolutions=(2,), spread=0.0, features=2, width=2, blob_radius=0.4)
    field = build_field(config, bound=BOUND)
    prepared = jax.jit(lambda key: field.prepare(field.init(key)))(jax.random.key(0))
    raw, colors = field.apply(prepared, points_as_gaussians(jnp.asarray([[0.0, 0.0, 0.0], [BOUND, BOUND, BOUND]])))
    np.testing.assert_allclose(raw, [config.blob, config.empty], atol=1e-4)
    np.testing.assert_allclose(colors, 0.5)
    assert float(total_variation(prepared["grid"])) == 0.0

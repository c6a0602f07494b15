"""Which numbers are used where: bfloat16 factors where a device is faster for it, float32 for all else."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import ResidualMLPConfig, validate
from dreamfields_core.config.fields import FIELD_KINDS
from dreamfields_core.fields import build_field
from dreamfields_core.precision import in_float32, product_type
from dreamfields_core.types import Gaussians

CONFIG = ResidualMLPConfig(frequencies=8, levels=4.0, width=32, bottleneck=64, blocks=2)


@pytest.mark.parametrize(
    ("platform", "expected"), [("cpu", "float32"), ("gpu", "bfloat16"), ("cuda", "bfloat16"), ("tpu", "bfloat16"), ("?", "float32")]
)
def test_auto_is_what_the_device_is_fast_in(platform: str, expected: str) -> None:
    assert product_type("auto", platform) == np.dtype(jnp.dtype(expected))


@pytest.mark.parametrize("platform", ["cpu", "gpu"])
@pytest.mark.parametrize("wanted", ["float32", "bfloat16"])
def test_what_is_named_is_taken(wanted: str, platform: str) -> None:
    assert product_type(wanted, platform).name == wanted  # type: ignore[arg-type]


def test_only_narrow_floats_are_widened() -> None:
    tree = {
        "bfloat16": jnp.ones(2, jnp.bfloat16),
        "float16": jnp.ones(2, jnp.float16),
        "float32": jnp.ones(2),
        "float64": np.ones(2),
        "int8": jnp.ones(2, jnp.int8),
        "bool": jnp.ones(2, bool),
    }
    types = {name: leaf.dtype.name for name, leaf in in_float32(tree).items()}
    assert types == {name: name for name in tree} | {"bfloat16": "float32", "float16": "float32"}


def products(jaxpr: jax.extend.core.Jaxpr) -> list[tuple[str, tuple[int, ...]]]:
    """Type and shape of the second factor of every matrix product, the ones inside calls too."""
    found = []
    for equation in jaxpr.eqns:
        if equation.primitive.name == "dot_general":
            found.append((equation.invars[1].aval.dtype.name, equation.invars[1].aval.shape))
        for inner in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda leaf: hasattr(leaf, "jaxpr")):
            if hasattr(inner, "jaxpr"):
                found += products(inner.jaxpr)
    return found


def precisions(jaxpr: jax.extend.core.Jaxpr) -> list[tuple[str, object]]:
    """Type of the factors and precision of every matrix product, the ones inside calls too."""
    found = []
    for equation in jaxpr.eqns:
        if equation.primitive.name == "dot_general":
            found.append((equation.invars[0].aval.dtype.name, equation.params["precision"]))
        for inner in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda leaf: hasattr(leaf, "jaxpr")):
            if hasattr(inner, "jaxpr"):
                found += precisions(inner.jaxpr)
    return found


@pytest.mark.parametrize("products_type", ["float32", "bfloat16"])
@pytest.mark.parametrize("kind", FIELD_KINDS)
def test_what_is_said_to_be_float32_is_not_rounded_by_any_device(kind: str, products_type: str) -> None:
    config = validate({"field": {"kind": kind}}).field
    field = build_field(config, bound=1.0, products=jnp.dtype(products_type))
    params = jax.eval_shape(field.init, jax.random.key(0))
    rays, spread = jax.ShapeDtypeStruct((4, 3), jnp.float32), jax.ShapeDtypeStruct((4,), jnp.float32)

    def loss(params: object, gaussians: Gaussians) -> jax.Array:
        prepared = field.prepare(params)
        raw, colors = field.apply(prepared, gaussians)
        return jnp.sum(raw) + jnp.sum(colors) + field.penalty(jax.random.key(0), prepared)

    found = precisions(jax.make_jaxpr(jax.value_and_grad(loss))(params, Gaussians(rays, rays, spread, spread)).jaxpr)
    assert found or kind in ("voxel_grid", "image_plane")
    wanted = (jax.lax.Precision.HIGHEST,) * 2
    assert all(precision == (wanted if name == "float32" else None) for name, precision in found), found


def asked(products_type: str) -> tuple[object, object, Gaussians]:
    field = build_field(CONFIG, bound=1.0, products=jnp.dtype(products_type))
    rng = np.random.default_rng(0)
    means = jnp.asarray(rng.uniform(-1, 1, (64, 3)), jnp.float32)
    small = jnp.full(64, 1e-4)
    return field, field.init(jax.random.key(0)), Gaussians(means, means, small, small)


def test_the_inner_products_alone_are_bfloat16() -> None:
    field, params, gaussians = asked("bfloat16")
    inner = {(CONFIG.width, CONFIG.bottleneck), (CONFIG.bottleneck, CONFIG.width), (CONFIG.width, CONFIG.width)}
    found = products(jax.make_jaxpr(field.apply)(params, gaussians).jaxpr)
    assert {shape for _, shape in found} > inner
    for name, shape in found:
        assert name == ("bfloat16" if shape in inner else "float32"), shape


def test_bfloat16_factors_change_the_field_by_their_rounding_and_no_more() -> None:
    field, params, gaussians = asked("bfloat16")
    exact, same, _ = asked("float32")
    for one, other in zip(jax.tree.leaves(params), jax.tree.leaves(same), strict=True):
        assert one.dtype == jnp.float32
        np.testing.assert_array_equal(one, other)
    (raw, color), (expected, expected_color) = field.apply(params, gaussians), exact.apply(params, gaussians)
    assert raw.dtype == color.dtype == jnp.float32
    # Five products of terms near 1, each factor rounded to one part in 512.
    assert 0 < np.abs(raw - expected).max() < 5 * 2 / 256
    assert np.abs(color - expected_color).max() < 5 * 0.25 * 2 / 256

    def slope(field: object) -> jax.Array:
        gradient = jax.grad(lambda params: jnp.sum(field.apply(params, gaussians)[0] ** 2))(params)
        return jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(gradient)])

    one, other = np.float64(slope(field)), np.float64(slope(exact))
    assert one @ other / np.linalg.norm(one) / np.linalg.norm(other) > 0.999

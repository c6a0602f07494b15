"""All that can come in: rays of every kind about a cube, and a medium of any density."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st

from dreamfields_core.fields.contract import Field
from dreamfields_core.types import Array, Gaussians, Rays

COLOR = (0.9, 0.4, 0.1)
HALVES = (jnp.bfloat16, jnp.float16)

DISTANCES = (1e-8, 1e-3, 1.0, 30.0, 1e4)
"""Of a camera from the scene's centre, in half-sides of the cube."""

RAW = st.one_of(
    st.sampled_from([-np.inf, -200.0, -88.0, -20.0, 0.0, 1.0, 80.0, 1e4, 1e30, 3e38, np.inf]),
    st.floats(-50.0, 10.0).map(lambda value: float(np.float32(value))),
)
"""Raw density: softplus of these runs from exactly 0 over all magnitudes to infinity."""

BOUNDS = st.integers(-8, 4).map(lambda exponent: float(np.float32(10.0**exponent)))
"""Half-sides of the cube; distances run with them."""


def medium(density_scale: float = 1.0) -> Field:
    """The same raw density, `prepared["raw"]`, and colour everywhere."""

    def apply(prepared: dict, gaussians: Gaussians) -> tuple[Array, Array]:
        count = gaussians.means.shape[0]
        return jnp.full(count, prepared["raw"]), jnp.tile(jnp.asarray(COLOR)[None, :], (count, 1))

    return Field(
        init=lambda key: {"raw": jnp.zeros(())},
        prepare=lambda params: params,
        apply=apply,
        penalty=lambda *_: jnp.zeros(()),
        density_scale=density_scale,
    )


def directions() -> np.ndarray:
    """[26, 3] unit vectors along all axes, toward all edges and corners; float32."""
    steps = np.array([step for step in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(step)])
    return np.float32(steps / np.linalg.norm(steps, axis=1, keepdims=True))


def rays_about(bound: float, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Starts and directions, float32: through the centre, on faces, edges and corners, just beside them, away from it, and within.

    Every direction of `directions` is aimed at each of the special places from `distance` half-sides before it.
    """
    aims = directions()
    places = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [1.001, 0, 0], [0.3, -0.7, 0.2], [0, 0, -1], [5, 5, 5]])
    aim, place = (grid.reshape(-1) for grid in np.meshgrid(np.arange(len(aims)), np.arange(len(places)), indexing="ij"))
    starts = np.float32(bound) * (places[place] - np.float32(distance) * aims[aim])
    return np.float32(starts), aims[aim]


def as_rays(starts: np.ndarray, toward: np.ndarray) -> Rays:
    """With the radii of a picture of some hundred pixels."""
    return Rays(jnp.asarray(starts), jnp.asarray(toward), jnp.full((len(starts), 1), 3e-3))


def halved(tree: object, half: object) -> object:
    """All floats in half precision."""
    return jax.tree.map(lambda leaf: leaf.astype(half) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf, tree)


def widened(tree: object) -> object:
    """The same numbers in float32."""
    return jax.tree.map(lambda leaf: leaf.astype(jnp.float32) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf, tree)

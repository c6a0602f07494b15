"""The state of a dream as named arrays, and back."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.dreaming.state import DreamState, StateMismatch, state_from_arrays, state_to_arrays
from dreamfields_core.rendering.occupancy import unknown_occupancy


def some_state() -> DreamState:
    return DreamState(
        step=jnp.int32(7),
        params={"layers": {"layer0": {"kernel": jnp.arange(6.0).reshape(2, 3)}}, "blocks": {0: jnp.ones(2)}},
        opt_state=(jnp.zeros(3), {"mu": jnp.ones((2, 2))}),
        origin=jnp.array([0.1, 0.2, 0.3]),
        occupancy=unknown_occupancy(2),
        rate_scale=jnp.float32(0.5),
        bad=jnp.int32(1),
    )


def test_there_and_back_again() -> None:
    state = some_state()
    arrays = state_to_arrays(state)
    assert all(isinstance(array, np.ndarray) for array in arrays.values())
    assert {"step", "origin", "occupancy/density", "occupancy/known", "params/layers/layer0/kernel", "opt_state/1/mu"} <= arrays.keys()
    assert len(arrays) == len(jax.tree.leaves(state))
    back = state_from_arrays(jax.tree.map(jnp.zeros_like, state), arrays)
    assert jax.tree.structure(back) == jax.tree.structure(state)
    for one, other in zip(jax.tree.leaves(back), jax.tree.leaves(state), strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


def test_a_missing_array_is_named() -> None:
    arrays = state_to_arrays(some_state())
    del arrays["params/layers/layer0/kernel"]
    with pytest.raises(StateMismatch, match='expected an array "params/layers/layer0/kernel" in the checkpoint, got none'):
        state_from_arrays(some_state(), arrays)


@pytest.mark.parametrize("wrong", [np.zeros((3, 2), np.float32), np.zeros((2, 3), np.float64)])
def test_another_shape_or_type_is_refused(wrong: np.ndarray) -> None:
    arrays = state_to_arrays(some_state()) | {"params/layers/layer0/kernel": wrong}
    with pytest.raises(StateMismatch, match=r'expected "params/layers/layer0/kernel" as float32\[2, 3\], got float(32|64)\[\d, \d\]'):
        state_from_arrays(some_state(), arrays)


def test_arrays_that_nobody_asked_for_are_ignored() -> None:
    state_from_arrays(some_state(), state_to_arrays(some_state()) | {"else": np.zeros(1)})

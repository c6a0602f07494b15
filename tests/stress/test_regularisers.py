"""Every regulariser at pictures that are wholly clear, wholly opaque and anything between: float64 twins of value and gradient.

A regulariser that joins the configuration joins here by itself, and fails until it has a twin.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import LossConfig
from dreamfields_core.config.dreams import Regularizer
from dreamfields_core.dreaming.losses import CLEAREST, regularized
from tests import reference

VIEWS, SIDE, COPIES = 2, 3, 2
LOSS = LossConfig(transmittance=0.5, beta=1e-3)


def mean_in_view(transmittance: np.ndarray) -> np.ndarray:
    return np.array([view.sum() / view.size for view in transmittance])


def score(cosines: np.ndarray) -> np.ndarray:
    """One mean cosine a view."""
    return np.array([sum(cosines[view * COPIES + copy] for copy in range(COPIES)) / COPIES for view in range(VIEWS)])


def clear_or_not(transmittance: np.ndarray) -> float:
    bounded = np.clip(transmittance, np.float64(np.float32(CLEAREST)), np.float64(np.float32(1.0 - CLEAREST)))
    return float(np.mean(np.log(bounded) + np.log(1.0 - bounded)))


TWINS: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray], float]] = {
    "none": lambda cosines, clear, target: -cosines.mean(),
    "density_noise": lambda cosines, clear, target: -cosines.mean(),
    "beta_prior": lambda cosines, clear, target: -cosines.mean() + LOSS.beta * clear_or_not(clear),
    "gated": lambda cosines, clear, target: -np.mean(mean_in_view(clear) * score(cosines)),
    "clipped_gated": lambda cosines, clear, target: -np.mean(np.minimum(target, mean_in_view(clear)) * score(cosines)),
    "clipped_additive": lambda cosines, clear, target: (
        -cosines.mean() + LOSS.transmittance * reference.clipped_transmittance(clear, target)
    ),
}


@functools.cache
def compiled(name: str) -> Callable:
    """(cosines, transmittance, target) -> value, gradients in the first two."""
    loss = LOSS.model_copy(update={"regularizer": name})
    return jax.jit(jax.value_and_grad(lambda *values: regularized(*values, loss), argnums=(0, 1)))


def check(name: str, cosines: np.ndarray, clear: np.ndarray, target: np.ndarray) -> None:
    cosines, clear, target = np.float32(cosines), np.float32(clear), np.float32(target)
    value, slopes = compiled(name)(*(jnp.asarray(array) for array in (cosines, clear, target)))
    exact = [np.float64(array) for array in (cosines, clear, target)]
    # Means of some ten terms near 1; the logarithms of the beta prior reach 14, at weight 1e-3.
    assert float(value) == pytest.approx(TWINS[name](*exact), abs=5e-7)
    assert all(np.isfinite(slope).all() for slope in slopes)
    if np.any(np.abs(mean_in_view(exact[1]) - exact[2]) < 1e-6):
        return  # on the corner of the clipping either slope is right

    def twin(flat: np.ndarray) -> float:
        return TWINS[name](flat[: cosines.size], flat[cosines.size :].reshape(clear.shape), exact[2])

    flat = np.concatenate([exact[0].ravel(), exact[1].ravel()])
    ours = np.concatenate([np.asarray(slope, np.float64).ravel() for slope in slopes])
    for place, axis in enumerate(np.eye(flat.size)):
        bounded = min(abs(flat[place] - CLEAREST), abs(1.0 - flat[place] - CLEAREST)) < 1e-7
        if name == "beta_prior" and place >= cosines.size and bounded:
            continue  # likewise
        # Central differences of 1e-9 in float64 keep 1e-7 of a value near 1; slopes of the beta prior reach 1e-3 x 1e6 / 18.
        assert ours[place] == pytest.approx(reference.slope(twin, flat, axis, 1e-9), rel=2e-2 if bounded else 1e-3, abs=5e-7), place


@pytest.mark.parametrize("tau", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("name", get_args(Regularizer))
def test_wholly_clear_and_wholly_opaque(name: str, tau: float) -> None:
    for value in (0.0, 1.0):
        check(name, np.array([-1.0, 1.0, 0.0, 0.3]), np.full((VIEWS, SIDE, SIDE), value), np.array([tau, 0.88]))


CLEAR = st.one_of(
    st.sampled_from([0.0, 1.0, 1e-30, 1e-8, 1e-5, 1.0 - 2**-24, 1.0 - 2**-18]),
    st.floats(1e-3, 1.0 - 1e-3).map(lambda x: float(np.float32(x))),
)


@pytest.mark.parametrize("name", get_args(Regularizer))
@settings(max_examples=15)
@given(
    clear=st.lists(CLEAR, min_size=VIEWS * SIDE**2, max_size=VIEWS * SIDE**2),
    cosines=st.lists(st.floats(-1.0, 1.0), min_size=VIEWS * COPIES, max_size=VIEWS * COPIES),
    tau=st.lists(st.sampled_from([0.0, 1e-6, 0.4, 0.88, 1.0]), min_size=VIEWS, max_size=VIEWS),
)
def test_any_picture(name: str, clear: list, cosines: list, tau: list) -> None:
    check(name, np.array(cosines), np.array(clear).reshape(VIEWS, SIDE, SIDE), np.array(tau))

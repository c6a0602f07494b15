"""Sine and cosine by polynomials, beside float64's."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dreamfields_core.fields.waves import HIGH, LOW, MIDDLE, QUARTER, sine_cosine

pytestmark = pytest.mark.usefixtures("strict_dtypes")

ERROR = 2e-7
LARGEST = 5e4


@pytest.mark.parametrize("scale", [1e-30, 1e-3, 1.0, 10.0, 1e3, LARGEST])
def test_are_those_of_float64(scale: float) -> None:
    angles = np.random.default_rng(0).uniform(-scale, scale, 200_000).astype(np.float32)
    sine, cosine = jax.jit(sine_cosine)(angles)
    np.testing.assert_allclose(sine, np.sin(angles.astype(np.float64)), atol=ERROR, rtol=0)
    np.testing.assert_allclose(cosine, np.cos(angles.astype(np.float64)), atol=ERROR, rtol=0)


def test_about_every_eighth_of_a_turn_where_quarters_meet() -> None:
    corners = (np.arange(-4000, 4001) * (np.pi / 4)).astype(np.float32)
    angles = np.concatenate([np.nextafter(corners, np.float32(-np.inf)), corners, np.nextafter(corners, np.float32(np.inf))])
    sine, cosine = sine_cosine(jnp.asarray(angles))
    np.testing.assert_allclose(sine, np.sin(angles.astype(np.float64)), atol=ERROR, rtol=0)
    np.testing.assert_allclose(cosine, np.cos(angles.astype(np.float64)), atol=ERROR, rtol=0)


@given(st.floats(-(2.0**-10), 2.0**-10, width=32))
def test_small_angles_keep_their_digits(angle: float) -> None:
    sine, cosine = sine_cosine(jnp.float32(angle))
    assert float(sine) == pytest.approx(np.sin(angle), rel=2e-7, abs=1e-37)
    assert float(cosine) == pytest.approx(1.0, abs=1e-6)


@given(st.floats(width=32))
def test_bounded_and_not_a_number_only_where_the_angle_is_not_finite(angle: float) -> None:
    for wave in sine_cosine(jnp.float32(angle)):
        assert abs(float(wave)) <= 1.0 + ERROR if np.isfinite(angle) else np.isnan(float(wave))


@given(st.floats(-LARGEST, LARGEST, width=32))
def test_slopes_are_each_other(angle: float) -> None:
    (sine, cosine), (sine_slope, cosine_slope) = jax.jvp(sine_cosine, (jnp.float32(angle),), (jnp.float32(1.0),))
    assert float(sine_slope) == float(cosine) and float(cosine_slope) == -float(sine)


def test_the_parts_of_a_quarter_turn() -> None:
    assert HIGH + MIDDLE + LOW == QUARTER
    for part, bits in ((HIGH, 7), (MIDDLE, 19)):
        assert abs(part) * 2**bits < 2**8 and part * 2**bits == int(part * 2**bits)

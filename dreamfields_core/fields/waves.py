"""Sine and cosine of an angle together, by two short polynomials.

A network's encoding asks for both of a hundred angles a sample, and XLA's own on a CPU, made for angles of any size, took a quarter of the
network's time. Encoded places lie about the scene's cube: their angles are some hundreds at most.

Symbols: x angle in radians; n = round(x / (pi / 2)), how many quarter turns; r = x - n pi / 2 in [-pi / 4, pi / 4]; z = r^2.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array

QUARTER = math.pi / 2
HIGH = round(QUARTER * 2**7) / 2**7
MIDDLE = round((QUARTER - HIGH) * 2**19) / 2**19
LOW = QUARTER - HIGH - MIDDLE
"""A quarter turn in three parts. The first two have eight bits, so that n times them, and what is left, is exact while n has fifteen."""

SINE = (-0.16666665, 0.00833275, -0.00019588)
COSINE = (0.041666647, -0.00138883035, 0.0000245480153)
"""a, b, c of sin r = r + r z (a + b z + c z^2) and cos r = 1 - z / 2 + z^2 (a + b z + c z^2), of least largest error on |r| <= pi / 4."""


@jax.custom_jvp
def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """sin x and cos x of angles of any shape, float32: to 2e-7 up to 5e4, in [-1, 1] however large; not a number where x is not finite."""
    turns = jnp.round(angle / QUARTER)
    rest = ((angle - turns * HIGH) - turns * MIDDLE) - turns * LOW
    # Beyond what the parts are exact for, the rest may be anything: it stays where the polynomials are waves. Not at pi / 4 itself, which
    # the rest of a large angle may pass by the rounding of its quarter turns.
    rest = jnp.clip(rest, -0.8, 0.8)
    square = rest * rest
    along = rest + rest * square * _polynomial(square, SINE)
    across = 1.0 - 0.5 * square + square * square * _polynomial(square, COSINE)
    # Of each half turn: whether it is its second quarter, where sine and cosine change places; of each turn: which half.
    half = jnp.floor(0.5 * turns)
    second = turns - 2.0 * half > 0.5
    sign = 1.0 - 2.0 * (half - 2.0 * jnp.floor(0.5 * half))
    return sign * jnp.where(second, across, along), sign * jnp.where(second, -along, across)


@sine_cosine.defjvp
def _slope(primals: tuple[Array], tangents: tuple[Array]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """The derivative is the other wave, not that of a polynomial."""
    (angle,), (moved,) = primals, tangents
    sine, cosine = sine_cosine(angle)
    return (sine, cosine), (cosine * moved, -sine * moved)


def _polynomial(square: Array, coefficients: tuple[float, float, float]) -> Array:
    first, second, third = coefficients
    return first + square * (second + square * third)

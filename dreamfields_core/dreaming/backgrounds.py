"""What stands behind the object in training (paper section 4.5): with a random background, haze cannot pass for an object.

All pictures are [H, W, 3] in [0, 1].
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.config import AugmentConfig
from dreamfields_core.dreaming.blur import gaussian_blur
from dreamfields_core.types import Array

DECAY = 1.5
"""Power by which the amplitude of a random texture falls with frequency."""

CONTRAST = 2.0
"""Standard deviation of a random texture before it is squashed into [0, 1]."""


def noise(key: Array, size: int) -> Array:
    """Every pixel and channel uniform on its own."""
    return jax.random.uniform(key, (size, size, 3))


def checkerboard(key: Array, size: int, *, checkers: int) -> Array:
    """Two random colours in `checkers` x `checkers` squares."""
    colors = jax.random.uniform(key, (2, 3))
    square = jnp.arange(size) * checkers // size
    return colors[(square[:, None] + square[None, :]) % 2]


def fourier_texture(key: Array, size: int) -> Array:
    """A random texture whose spectrum falls as 1 / frequency^DECAY, in random but related colours.

    Its three channels are a lightness and two colour differences of lesser contrast, as in photographs.
    """
    frequency = jnp.sqrt(jnp.fft.fftfreq(size)[:, None] ** 2 + jnp.fft.rfftfreq(size)[None, :] ** 2)
    falloff = jnp.maximum(frequency, 1.0 / size) ** -DECAY
    white = jax.random.normal(key, (3, size, size))
    texture = jnp.fft.irfft2(jnp.fft.rfft2(white) * falloff[None], s=(size, size))
    spread = jnp.std(texture, axis=(1, 2), keepdims=True)
    texture = CONTRAST * texture / jnp.maximum(spread, 1e-6)
    light, red_green, blue_yellow = texture[0], 0.5 * texture[1], 0.5 * texture[2]
    channels = [light + red_green + 0.5 * blue_yellow, light - red_green + 0.5 * blue_yellow, light - blue_yellow]
    return jax.nn.sigmoid(jnp.stack(channels, axis=-1))


def solid(key: Array, size: int) -> Array:
    """One random colour."""
    return jnp.broadcast_to(jax.random.uniform(key, (3,)), (size, size, 3))


def random_background(key: Array, *, size: int, augment: AugmentConfig) -> Array:
    """One of the kinds that `augment` names, each as likely, blurred by a random width."""
    kind_key, draw_key, blur_key = jax.random.split(key, 3)
    painters = {
        "noise": lambda draw: noise(draw, size),
        "checkerboard": lambda draw: checkerboard(draw, size, checkers=augment.checkers),
        "fourier": lambda draw: fourier_texture(draw, size),
        "solid": lambda draw: solid(draw, size),
        "white": lambda draw: jnp.ones((size, size, 3)),
    }
    kind = jax.random.randint(kind_key, (), 0, len(augment.backgrounds))
    picture = jax.lax.switch(kind, [painters[name] for name in augment.backgrounds], draw_key)
    return gaussian_blur(picture, jax.random.uniform(blur_key, (), maxval=augment.blur))

"""What dreaming does to pictures, done to the lessons: shift, scale, blur, low resolution, fog, noise, and any background.

Pictures are RGBA [batch, size, size, 4] in [0, 1], colour premultiplied; results are RGB [batch, size, size, 3] in [0, 1].
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from dreamfields_core.types import Array


def spoil(key: Array, pictures: Array) -> Array:
    """Each picture seen through its own lens, before its own background."""
    keys = jax.random.split(key, 5)
    batch, size = pictures.shape[:2]
    x = fog(keys[1], see_through_lens(keys[0], pictures))
    x = x[..., :3] + (1 - x[..., 3:]) * background(keys[2], batch, size)
    noisy = jax.random.uniform(keys[3], (2, batch, 1, 1, 1))
    x = x + jnp.where(noisy[0] < 0.5, 0.08 * noisy[1], 0) * jax.random.normal(keys[4], x.shape)
    return jnp.clip(x, 0, 1)


def see_through_lens(key: Array, pictures: Array) -> Array:
    """Mirrors half of them, scales by .85 to 1.15, shifts by up to a tenth, blurs 40 %, coarsens 12 %."""
    batch, size = pictures.shape[:2]
    u = jax.random.uniform(key, (7, batch, 1))
    mirror = jnp.where(u[0] < 0.5, -1.0, 1.0)
    zoom = 0.85 + 0.3 * u[1]
    width = jnp.where(u[2] < 0.4, 0.35 + 1.2 * u[3], 0.35)
    coarse = jnp.where(u[4] < 0.12, 2.0, 1.0)
    place = jnp.arange(size) + 0.5
    place = (jnp.floor(place[None, :] / coarse) + 0.5) * coarse - size / 2
    width = jnp.maximum(width, 0.5 * (coarse > 1) * coarse)
    reach = 0.1 * size
    rows = _lens(place / zoom + reach * (2 * u[5] - 1), width, size)
    columns = _lens(mirror * place / zoom + reach * (2 * u[6] - 1), width, size)
    return jnp.einsum("bih,bhwc,bjw->bijc", rows, pictures, columns)


def _lens(place: Array, width: Array, size: int) -> Array:
    """Gaussian weights [batch, size, size] of source pixels for each target; `place` is measured from the middle. Outside is empty."""
    pad = size // 4
    source = jnp.arange(-pad, size + pad) + 0.5 - size / 2
    weights = jnp.exp(-0.5 * ((place[:, :, None] - source[None, None, :]) / width[:, :, None]) ** 2)
    weights = weights / (weights.sum(-1, keepdims=True) + 1e-6)
    return weights[:, :, pad:-pad]


def fog(key: Array, pictures: Array) -> Array:
    """Opacity of 40 % of them is scaled by .45 to 1, half of these unevenly."""
    batch, size = pictures.shape[:2]
    first, second = jax.random.split(key)
    u = jax.random.uniform(first, (3, batch, 1, 1, 1))
    uneven = _waves(second, batch, size)[..., :1]
    depth = jnp.where(u[1] < 0.5, 1.0, 0.5 + 0.5 * uneven)
    return pictures * jnp.where(u[0] < 0.4, 1 - 0.55 * u[2] * depth, 1.0)


def background(key: Array, batch: int, size: int) -> Array:
    """White .3, one colour .2, noise .15, checkers .15, waves .2; noise and checkers are blurred. [batch, size, size, 3]."""
    keys = jax.random.split(key, 6)
    which = jax.random.uniform(keys[0], (batch, 1, 1, 1))
    colors = jax.random.uniform(keys[1], (2, batch, 1, 1, 3))
    noise = colors[0] + 0.6 * colors[1] * jax.random.normal(keys[2], (batch, size, size, 3))
    u = jax.random.uniform(keys[3], (4, batch, 1, 1))
    cell = 3 + 13 * u[0]
    place = jnp.arange(size)
    odd = (jnp.floor((place[None, :, None] + size * u[1]) / cell) + jnp.floor((place[None, None, :] + size * u[2]) / cell)) % 2
    checkers = jnp.where(odd[..., None] > 0, colors[0], colors[1])
    busy = jnp.where(which < 0.65, noise, checkers)
    blur = jax.random.uniform(keys[4], (batch, 1)) ** 2 * 4 + 0.2
    lens = _lens(jnp.broadcast_to(place[None, :] + 0.5 - size / 2, (batch, size)), blur, size)
    busy = jnp.einsum("bih,bhwc,bjw->bijc", lens / (lens.sum(-1, keepdims=True) + 1e-6), busy, lens / (lens.sum(-1, keepdims=True) + 1e-6))
    x = jnp.where(which < 0.8, busy, _waves(keys[5], batch, size))
    return jnp.clip(jnp.where(which < 0.3, 1.0, jnp.where(which < 0.5, colors[0], x)), 0, 1)


def _waves(key: Array, batch: int, size: int, *, terms: int = 5) -> Array:
    """Random Fourier textures in [0, 1]: sums of products of two cosines, [batch, size, size, 3]."""
    u = jax.random.uniform(key, (4, batch, terms, 1))
    place = jnp.linspace(0, 2 * jnp.pi, size)[None, None, :]
    rows = jnp.cos(5 * u[0] * place + 6.3 * u[1])
    columns = jnp.cos(5 * u[2] * place + 6.3 * u[3])
    weights = jax.random.normal(jax.random.fold_in(key, 1), (batch, terms, 3))
    return jax.nn.sigmoid(1.5 * jnp.einsum("bth,btw,btc->bhwc", rows, columns, weights))


def junk(key: Array, images: Array) -> Array:
    """As many pictures that no caption fits: quarters of four pictures, or one picture's quarters in another order."""
    half = images.shape[1] // 2
    ul, ur, ll, lr = images[:, :half, :half], images[:, :half, half:], images[:, half:, :half], images[:, half:, half:]
    mixed = jax.random.uniform(key, (images.shape[0], 1, 1, 1)) < 0.5
    ur, ll, lr = (jnp.where(mixed, jnp.roll(quarter, i, 0), quarter) for i, quarter in enumerate((ur, ll, lr), 1))
    return jnp.concatenate([jnp.concatenate([lr, ll], 2), jnp.concatenate([ur, ul], 2)], 1)

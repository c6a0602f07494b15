"""Backgrounds, blur and crops: their ranges, their statistics, and that every one of them can be drawn."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.ndimage
import scipy.stats

from dreamfields_core.config import AugmentConfig
from dreamfields_core.dreaming.augmentations import augmented_copies, random_crop
from dreamfields_core.dreaming.backgrounds import checkerboard, fourier_texture, noise, random_background, solid
from dreamfields_core.dreaming.blur import REACH, blur_matrix, gaussian_blur
from dreamfields_core.types import Rendering
from tests import reference

DRAWS = 60


def many(painter: object, *, count: int = DRAWS) -> np.ndarray:
    return np.asarray(jax.jit(jax.vmap(painter))(jax.random.split(jax.random.key(0), count)))


def test_noise_is_uniform_and_independent() -> None:
    pictures = many(lambda key: noise(key, 16))
    assert pictures.shape == (DRAWS, 16, 16, 3)
    assert scipy.stats.kstest(pictures.ravel(), "uniform").pvalue > 1e-3
    # 15 000 pairs: standard error of a correlation 0.008.
    assert abs(np.corrcoef(pictures[:, :, :-1].ravel(), pictures[:, :, 1:].ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(pictures[..., 0].ravel(), pictures[..., 1].ravel())[0, 1]) < 0.03


@pytest.mark.parametrize(("size", "checkers"), [(16, 8), (13, 4), (4, 8), (1, 8)])
def test_a_checkerboard_has_two_colours_in_squares(size: int, checkers: int) -> None:
    picture = np.asarray(checkerboard(jax.random.key(1), size, checkers=checkers))
    for row in range(size):
        for column in range(size):
            odd = (row * checkers // size + column * checkers // size) % 2
            same = [(r, c) for r in range(size) for c in range(size) if (r * checkers // size + c * checkers // size) % 2 == odd]
            np.testing.assert_array_equal(picture[row, column], picture[same[0]])
    if size >= checkers:
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 2


def test_checkerboards_colours_are_uniform() -> None:
    pictures = many(lambda key: checkerboard(key, 8, checkers=8), count=400)
    assert scipy.stats.kstest(pictures[:, 0, :2].ravel(), "uniform").pvalue > 1e-3


def test_fourier_textures_fall_off_and_lie_about_the_middle() -> None:
    pictures = many(lambda key: fourier_texture(key, 32), count=200)
    assert pictures.min() >= 0 and pictures.max() <= 1 and np.isfinite(pictures).all()
    assert pictures.mean() == pytest.approx(0.5, abs=0.05)
    spread = pictures.std(axis=(1, 2)).mean()
    assert 0.15 < spread < 0.4  # neither flat nor black and white
    logits = np.log(np.clip(pictures, 1e-6, 1 - 1e-6) / (1 - np.clip(pictures, 1e-6, 1 - 1e-6))).sum(axis=-1)
    power = (np.abs(np.fft.fft2(logits)) ** 2).mean(axis=0)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(32), np.fft.fftfreq(32), indexing="ij"))
    band = (frequency > 1.5 / 32) & (frequency < 0.45)
    falloff = np.polyfit(np.log(frequency[band]), np.log(power[band]), 1)[0]
    # Amplitude falls by the power 1.5, so power by 3; normalising each picture's contrast hardly bends that.
    assert falloff == pytest.approx(-3.0, abs=0.2)
    # The channels are related, not equal.
    correlation = np.corrcoef(pictures[..., 0].ravel(), pictures[..., 1].ravel())[0, 1]
    assert 0.2 < correlation < 0.95


def test_a_solid_is_one_colour() -> None:
    pictures = many(lambda key: solid(key, 4), count=300)
    np.testing.assert_array_equal(pictures, np.broadcast_to(pictures[:, :1, :1], pictures.shape))
    assert scipy.stats.kstest(pictures[:, 0, 0].ravel(), "uniform").pvalue > 1e-3


def test_every_kind_of_background_is_as_likely() -> None:
    # Unblurred, each kind gives itself away: white, one colour, two, many.
    augment = AugmentConfig(backgrounds=("white", "solid", "checkerboard", "noise"), blur=0.0, checkers=4)
    pictures = many(lambda key: random_background(key, size=8, augment=augment), count=400)
    colors = np.array([len(np.unique(picture.reshape(-1, 3), axis=0)) for picture in pictures])
    white = np.array([(picture == 1.0).all() for picture in pictures])
    counts = [white.sum(), ((colors == 1) & ~white).sum(), (colors == 2).sum(), (colors > 2).sum()]
    assert sum(counts) == 400
    assert scipy.stats.chisquare(counts).pvalue > 1e-3


@pytest.mark.parametrize("size", [1, 7])
@pytest.mark.parametrize("kind", ["noise", "checkerboard", "fourier", "solid", "white"])
def test_small_backgrounds_are_pictures_too(kind: str, size: int) -> None:
    augment = AugmentConfig(backgrounds=(kind,))
    picture = np.asarray(jax.jit(lambda key: random_background(key, size=size, augment=augment))(jax.random.key(2)))
    assert picture.shape == (size, size, 3)
    assert np.isfinite(picture).all() and picture.min() >= 0 and picture.max() <= 1 + 1e-6


blur = jax.jit(gaussian_blur)
PICTURE = np.random.default_rng(0).uniform(size=(20, 17, 3)).astype(np.float32)


@pytest.mark.parametrize("deviation", [0.0, 0.3, 1.0, 3.0, 10.0])
def test_blur_against_a_loop(deviation: float) -> None:
    twin = reference.blur(np.float64(PICTURE), deviation, REACH)
    np.testing.assert_allclose(blur(PICTURE, deviation), twin, atol=2e-6)


def test_blur_agrees_with_scipy_away_from_the_border() -> None:
    picture = np.random.default_rng(1).uniform(size=(30, 30, 1)).astype(np.float32)
    trusted = scipy.ndimage.gaussian_filter(np.float64(picture), (2.0, 2.0, 0.0), radius=(REACH, REACH, 0))
    inner = slice(REACH, -REACH)
    np.testing.assert_allclose(np.asarray(blur(picture, 2.0))[inner, inner], trusted[inner, inner], atol=2e-6)


def test_blur_of_width_0_is_the_identity_with_a_finite_slope() -> None:
    np.testing.assert_array_equal(blur(PICTURE, 0.0), PICTURE)
    for deviation in (0.0, 1e-30, 1e-3, 1e-2, 5.0):
        slope = jax.jit(jax.grad(lambda deviation: jnp.sum(gaussian_blur(jnp.asarray(PICTURE), deviation) ** 2)))(deviation)
        assert np.isfinite(slope)


@pytest.mark.parametrize("deviation", [0.0, 0.5, 10.0, 1e6])
def test_blur_weights_add_up_to_one_so_a_flat_picture_stays(deviation: float) -> None:
    np.testing.assert_allclose(np.asarray(blur_matrix(12, jnp.float32(deviation))).sum(axis=1), 1.0, rtol=3e-7)
    np.testing.assert_allclose(blur(np.full((20, 17, 3), 0.37, np.float32), deviation), 0.37, rtol=1e-6)


def test_crops_reach_every_offset_equally_often() -> None:
    size, crop = 7, 5
    picture = jnp.arange(size * size, dtype=jnp.float32).reshape(size, size, 1)
    corners = many(lambda key: random_crop(key, picture, crop=crop)[0, 0, 0], count=900).astype(int)
    counts = np.bincount(corners, minlength=size * size).reshape(size, size)
    assert (counts[:3, :3] > 0).all() and counts[:3, :3].sum() == 900  # nine offsets, 0, 1, 2 each way
    assert scipy.stats.chisquare(counts[:3, :3].ravel()).pvalue > 1e-3


def test_a_crop_is_a_piece_of_the_picture() -> None:
    picture = jnp.arange(7.0 * 7 * 2).reshape(7, 7, 2)
    out = np.asarray(random_crop(jax.random.key(0), picture, crop=4))
    row, column = np.argwhere(np.asarray(picture)[..., 0] == out[0, 0, 0])[0]
    np.testing.assert_array_equal(out, np.asarray(picture)[row : row + 4, column : column + 4])
    np.testing.assert_array_equal(random_crop(jax.random.key(0), picture, crop=7), picture)


def views(count: int, size: int, *, transmittance: float) -> Rendering:
    shape = (count, size, size)
    return Rendering(jnp.full((*shape, 3), 0.2), jnp.full(shape, transmittance), jnp.zeros(shape))


copied = jax.jit(augmented_copies, static_argnames=("augment", "crop"))


def test_copies_stand_on_backgrounds_of_their_own() -> None:
    augment = AugmentConfig(copies=3)
    pictures = np.asarray(copied(jax.random.key(0), views(2, 8, transmittance=1.0), augment=augment, crop=6))
    assert pictures.shape == (6, 6, 6, 3)
    assert pictures.min() >= 0 and pictures.max() <= 1
    for first in range(6):
        for second in range(first):
            assert np.any(pictures[first] != pictures[second])


def test_copies_are_premultiplied_over_and_in_the_order_of_their_views() -> None:
    augment = AugmentConfig(backgrounds=("white",), copies=2)
    both = jax.tree.map(lambda *leaves: jnp.concatenate(leaves), views(1, 6, transmittance=0.5), views(1, 6, transmittance=0.0))
    pictures = copied(jax.random.key(0), both, augment=augment, crop=6)
    np.testing.assert_allclose(pictures[:2], 0.7, rtol=1e-6)
    np.testing.assert_allclose(pictures[2:], 0.2, rtol=1e-6)


def test_an_opaque_view_hides_every_background() -> None:
    pictures = copied(jax.random.key(0), views(2, 8, transmittance=0.0), augment=AugmentConfig(copies=3), crop=6)
    np.testing.assert_allclose(pictures, 0.2, rtol=1e-6)

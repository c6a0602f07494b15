"""Preprocessing: pixel for pixel the published one where it rounds as that does, and a gradient where it does not."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.guidance.architecture import Pixels
from dreamfields_core.guidance.preprocess import prepared, resize_matrix, resized

HALF, CLIP_MEAN, CLIP_STD = (0.5, 0.5, 0.5), (0.48145466, 0.4578275, 0.40821073), (0.26862954, 0.26130258, 0.27577711)
SIZES = [(154, 154), (31, 57), (300, 225), (225, 300), (512, 512), (224, 1), (449, 224)]


def noise(height: int, width: int) -> np.ndarray:
    """Half noise, half hard edges, where a cubic kernel overshoots most."""
    rng = np.random.default_rng(height * 1000 + width)
    picture = rng.integers(0, 256, (height, width, 3), np.uint8)
    return np.where(rng.random((height, width, 1)) < 0.5, picture, np.uint8(255) * (picture > 127)).astype(np.uint8)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_clip_pixel_for_pixel(height: int, width: int) -> None:
    transformers = pytest.importorskip("transformers")
    from PIL import Image

    picture = noise(height, width)
    reference = transformers.CLIPImageProcessorPil()
    pixels = Pixels(224, CLIP_MEAN, CLIP_STD, "bicubic", fit="shortest")
    expected = reference(Image.fromarray(picture), return_tensors="np")["pixel_values"][0].transpose(1, 2, 0)
    ours = np.asarray(prepared(picture[None].astype(np.float32) / 255, pixels, eight_bits=True)[0])
    np.testing.assert_allclose(ours, expected, atol=1e-5)


@pytest.mark.parametrize("resample", ["bicubic", "bilinear"])
@pytest.mark.parametrize(("height", "width"), SIZES)
def test_siglip_pixel_for_pixel(height: int, width: int, resample: str) -> None:
    transformers = pytest.importorskip("transformers")
    from PIL import Image

    picture = noise(height, width)
    reference = transformers.SiglipImageProcessorPil(
        size={"height": 256, "width": 256}, resample=getattr(Image.Resampling, resample.upper())
    )
    expected = reference(Image.fromarray(picture), return_tensors="np")["pixel_values"][0].transpose(1, 2, 0)
    pixels = Pixels(256, HALF, HALF, resample)  # type: ignore[arg-type]
    ours = np.asarray(prepared(picture[None].astype(np.float32) / 255, pixels, eight_bits=True)[0])
    np.testing.assert_allclose(ours, expected, atol=1e-5)


@pytest.mark.parametrize("method", ["bicubic", "bilinear"])
@pytest.mark.parametrize(("source", "target"), [(154, 224), (300, 224), (17, 5), (5, 17)])
def test_values_and_gradients_agree_with_pytorch(method: str, source: int, target: int) -> None:
    """PyTorch places its samples in single precision, which is all that differs."""
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(0)
    picture, weight = rng.random((1, source, source, 3), np.float32), rng.normal(size=(1, target, target, 3)).astype(np.float32)
    pixels = Pixels(target, HALF, HALF, method)  # type: ignore[arg-type]
    given = torch.tensor(picture.transpose(0, 3, 1, 2), requires_grad=True)
    theirs = torch.nn.functional.interpolate(given, (target, target), mode=method, antialias=True)
    (theirs * torch.tensor(weight.transpose(0, 3, 1, 2))).sum().backward()
    np.testing.assert_allclose(resized(picture, pixels), theirs.detach().numpy().transpose(0, 2, 3, 1).clip(0, 1), atol=1e-4)
    gradient = jax.grad(lambda images: jnp.sum(resized(images, pixels) * weight))(jnp.asarray(picture))
    np.testing.assert_allclose(gradient, given.grad.numpy().transpose(0, 2, 3, 1), atol=1e-3)


def test_lit_shrinks_without_a_filter_and_leaves_its_own_size_alone() -> None:
    torch = pytest.importorskip("torch")
    picture = np.random.default_rng(0).random((1, 300, 300, 3), np.float32)
    pixels = Pixels(224, HALF, HALF, "bilinear", antialias=False)
    theirs = torch.nn.functional.interpolate(torch.tensor(picture.transpose(0, 3, 1, 2)), (224, 224), mode="bilinear", antialias=False)
    np.testing.assert_allclose(resized(picture, pixels), theirs.numpy().transpose(0, 2, 3, 1), atol=1e-4)
    same = picture[:, :224, :224]
    np.testing.assert_array_equal(resized(same, pixels), same)


def test_rows_sum_to_one_and_a_flat_picture_stays_flat() -> None:
    for method in ("bicubic", "bilinear"):
        for source, target in [(1, 1), (1, 9), (9, 1), (224, 224), (225, 224), (1000, 3)]:
            matrix = resize_matrix(source, target, method)  # type: ignore[arg-type]
            assert matrix.shape == (target, source)
            np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-6)
    pixels = Pixels(224, HALF, HALF)
    np.testing.assert_allclose(resized(np.full((1, 33, 77, 3), 0.7, np.float32), pixels), 0.7, atol=1e-6)


def test_rounding_keeps_the_gradient() -> None:
    pixels = Pixels(8, HALF, HALF)
    picture = np.random.default_rng(0).random((1, 20, 20, 3), np.float32)
    rough = jax.grad(lambda images: jnp.sum(resized(images, pixels, eight_bits=True) ** 2))(picture)
    smooth = jax.grad(lambda images: jnp.sum(resized(images, pixels) ** 2))(picture)
    assert np.abs(rough - smooth).max() < 0.02 * np.abs(smooth).max()


def test_a_picture_without_its_batch_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected images \[batch, height, width, 3\] in \[0, 1\], got shape \(8, 8, 3\)"):
        prepared(np.zeros((8, 8, 3), np.float32), Pixels(8, HALF, HALF))

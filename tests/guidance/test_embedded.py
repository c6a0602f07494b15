"""The contract of `Encoder`, kept by our own models: by a fresh one of each way of seeing, and by those that ship."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.guidance import embedded
from dreamfields_core.guidance.tokens import CaptionCut
from flows.train_embedded import WEIGHTS, load

VOCABULARY = ("a", "red", "blue", "mug")
SIZES = {"image_size": 16, "dim": 16, "fine": 8, "coarse": 16, "fine_blocks": 1, "coarse_blocks": 1, "text_width": 16}
SHIPPED = sorted(Path(WEIGHTS).glob("*.safetensors"))


def fresh(seeing: str) -> embedded.Model:
    return embedded.create(jax.random.key(0), VOCABULARY, seeing=seeing, **SIZES)


@pytest.fixture(scope="module", params=["convolution", "attention", *SHIPPED], ids=lambda value: getattr(value, "stem", value))
def encoder(request):
    if isinstance(request.param, Path):
        return load(request.param)
    return embedded.encoder("fresh", fresh(request.param), "digest")


@pytest.fixture(scope="module")
def look(encoder):
    """Compiled once: one picture of the model's size -> (a sum of its embedding, that sum's gradient)."""
    return jax.jit(jax.value_and_grad(lambda x: encoder.encode_image(encoder.params, x)[0, :4].sum()))


@pytest.mark.parametrize("batch", [0, 3])
def test_embeddings_are_unit_vectors(encoder, batch: int) -> None:
    images = jax.random.uniform(jax.random.key(1), (batch, 20, 28, 3))
    vectors = jax.jit(encoder.encode_image)(encoder.params, images)
    assert vectors.shape == (batch, encoder.dim)
    np.testing.assert_allclose(jnp.linalg.norm(vectors, axis=-1), np.ones(batch), atol=1e-5)
    texts = jax.jit(encoder.encode_text)(encoder.params, encoder.tokenize(["a red mug"] * batch))
    assert texts.shape == (batch, encoder.dim)
    np.testing.assert_allclose(jnp.linalg.norm(texts, axis=-1), np.ones(batch), atol=1e-5)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_the_gradient_in_the_image_is_finite_even_where_all_is_one_colour(encoder, look, value: float) -> None:
    slope = look(jnp.full((1, encoder.image_size, encoder.image_size, 3), value))[1]
    assert np.isfinite(slope).all()
    assert float(jnp.abs(slope).max()) > 0


def test_the_gradient_is_that_of_finite_differences(encoder, look) -> None:
    size, step = encoder.image_size, 2e-3
    images = jax.random.uniform(jax.random.key(2), (1, size, size, 3), minval=0.2, maxval=0.8)
    way = jax.random.normal(jax.random.key(3), images.shape)
    numeric = (float(look(images + step * way)[0]) - float(look(images - step * way)[0])) / (2 * step)
    assert float((look(images)[1] * way).sum()) == pytest.approx(numeric, rel=0.05, abs=2e-3)


def test_one_picture_does_not_depend_on_its_batch(encoder, look) -> None:
    size = encoder.image_size
    images = jax.random.uniform(jax.random.key(4), (3, size, size, 3))
    together = jax.jit(encoder.encode_image)(encoder.params, images)
    np.testing.assert_allclose(together[1, :4].sum(), look(images[1:2])[0], atol=1e-5)


def test_padding_does_not_change_a_caption(encoder) -> None:
    tokens = encoder.tokenize(["a red mug"])
    texts = [jax.jit(encoder.encode_text)(encoder.params, t) for t in (tokens, tokens[:, :6])]
    np.testing.assert_allclose(*texts, atol=1e-5)


def test_unknown_words_are_named(encoder) -> None:
    assert encoder.unknown_words("A red zeppelin, a ZEPPELIN mug!") == ("zeppelin",)
    assert encoder.tokenize(["zeppelin"])[0, 0] == embedded.UNKNOWN


@pytest.mark.parametrize("caption", ["", " . , "])
def test_an_empty_caption_is_refused_in_one_sentence(encoder, caption: str) -> None:
    with pytest.raises(ValueError, match="expected a caption"):
        encoder.tokenize([caption])


@pytest.mark.parametrize("seeing", ["convolution", "attention"])
def test_arrays_there_and_back_are_identical(seeing: str) -> None:
    model = fresh(seeing)
    arrays, metadata = embedded.to_arrays(model, dtype=np.float32)
    assert all(isinstance(value, str) for value in metadata.values())
    back = embedded.model_from_arrays("again", arrays, metadata)
    assert (back.architecture, back.vocabulary) == (model.architecture, model.vocabulary)
    jax.tree.map(np.testing.assert_array_equal, back.params, model.params)


def test_damaged_weights_are_refused_in_one_sentence() -> None:
    arrays, metadata = embedded.to_arrays(fresh("convolution"))
    with pytest.raises(ValueError, match="expected weights of format"):
        embedded.from_arrays("x", arrays, {}, "digest")
    arrays.pop("image.stem.w")
    with pytest.raises(ValueError, match=r"expected array 'image.stem.w'"):
        embedded.from_arrays("x", arrays, metadata, "digest")


def test_shipped_weights_fit_in_the_repository() -> None:
    assert sum(path.stat().st_size for path in SHIPPED) <= 16 * 2**20


def test_a_long_caption_is_cut_and_told_where() -> None:
    tokenize = embedded.tokenizer(("a", "red", "mug"), 4, name="small")
    with pytest.warns(CaptionCut, match='^small reads 4 words and this caption has 6: it is cut after "a red mug a"$'):
        np.testing.assert_array_equal(tokenize(["A red mug, a red mug."]), [[2, 3, 4, 2]])

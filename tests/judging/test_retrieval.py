"""R-Precision: ranks with ties and what is not a number, and the error of a mean."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.judging.retrieval import mean_with_error, ranks_of_first, retrieve
from dreamfields_core.types import Encoder
from tests import reference

VALUES = st.sampled_from([-1.0, -0.5, 0.0, 0.25, 0.25 + 1e-12, 1.0, float("nan")])


@settings(max_examples=100)
@given(rows=st.lists(st.lists(VALUES, min_size=4, max_size=4), min_size=1, max_size=3))
def test_ranks_against_a_loop(rows: list) -> None:
    np.testing.assert_array_equal(ranks_of_first(np.array(rows)), reference.ranks(np.array(rows)))


@pytest.mark.parametrize(
    ("row", "rank"),
    [
        ([0.5, 0.4, 0.3], 1),
        ([0.5, 0.6, 0.3], 2),
        ([0.5, 0.5, 0.3], 2),
        ([0.5, 0.5, 0.5], 3),
        ([np.nan, 0.1, 0.2], 3),
        ([0.5, np.nan, 0.2], 2),
        ([0.5], 1),
    ],
)
def test_ranks(row: list, rank: int) -> None:
    """Ties, and whatever is not a number, count against the caption: no object is right by a fault."""
    assert ranks_of_first(np.array([row])).tolist() == [rank]


LETTERS = "abcdefgh"


def encoder() -> Encoder:
    """Texts are unit vectors by first letter; a picture is its mean colour, in the first three of them."""

    def encode_image(params: jnp.ndarray, images: jnp.ndarray) -> jnp.ndarray:
        colors = jnp.pad(jnp.mean(images, axis=(1, 2)), ((0, 0), (0, len(LETTERS) - 3)))
        return colors / jnp.linalg.norm(colors, axis=1, keepdims=True)

    return Encoder(
        name="letters",
        digest="0" * 64,
        image_size=2,
        dim=len(LETTERS),
        params=jnp.eye(len(LETTERS)),
        tokenize=lambda captions: np.array([[LETTERS.index(caption[0])] for caption in captions], np.int32),
        encode_text=lambda params, tokens: params[tokens[:, 0]],
        encode_image=encode_image,
    )


IMAGES = np.ones((2, 3, 3, 3)) * np.array([[0.8, 0.6, 0.0], [0.0, 0.6, 0.8]])[:, None, None, :]


def test_retrieval_of_known_pictures() -> None:
    result = retrieve(encoder(), IMAGES, "a thing", ["b thing", "c thing", "d thing"])
    np.testing.assert_allclose(result.similarities, [0.8, 0.0], atol=1e-6)
    # In the second picture both b and c are better, and d is as good.
    assert result.ranks == (1, 4) and result.rank == 1 and result.correct and result.pool == 4
    assert result.similarity == result.similarities[0]


def test_two_captions_that_float32_cannot_tell_apart_are_ranked() -> None:
    """Scores 1 + 2^-26 and 1: a product in float32 would say 1 and 1."""
    near = jnp.asarray([[1.0, 2.0**-13], [1.0, 0.0]])
    looking = dataclasses.replace(
        encoder(),
        encode_text=lambda params, tokens: near[tokens[:, 0]],
        encode_image=lambda params, images: near[:1].repeat(len(images), 0),
    )
    assert retrieve(looking, IMAGES, "a thing", ["b thing"]).ranks == (1, 1)


def test_the_caption_itself_and_repeated_ones_count_once() -> None:
    result = retrieve(encoder(), IMAGES, "b thing", ["b thing", "a thing", "a thing", "b thing"])
    assert result.pool == 2 and result.ranks == (2, 1) and not result.correct


def test_nothing_but_the_caption() -> None:
    result = retrieve(encoder(), IMAGES[:1], "c thing", [])
    assert result.pool == 1 and result.correct


def test_a_picture_that_is_not_a_number_is_last() -> None:
    result = retrieve(encoder(), np.full((1, 2, 2, 3), np.nan), "a thing", ["b thing", "c thing"])
    assert result.rank == 3 and not result.correct


@settings(max_examples=30)
@given(values=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=20))
def test_standard_error_agrees_with_scipy(values: list) -> None:
    mean, error = mean_with_error(values)
    assert mean == pytest.approx(np.mean(values), abs=1e-12)
    assert error == pytest.approx(float(scipy.stats.sem(values)), abs=1e-12)


def test_the_error_of_one_value_is_unknown_and_of_none_an_error() -> None:
    mean, error = mean_with_error([0.25])
    assert mean == 0.25 and np.isnan(error)
    with pytest.raises(ValueError, match="expected at least one value to average, got none"):
        mean_with_error([])

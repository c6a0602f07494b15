"""Examinations: what cannot tell captions apart finds none, what can finds all, and an attack keeps to its ball."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.teaching import examination, pools, report, words
from dreamfields_core.teaching.language import parse
from dreamfields_core.types import Array, Encoder

DIM = 64
SIZE = 48
DESCRIPTIONS = pools.random_pool(np.random.default_rng(0), 5)


def encoder(collapse: float | None = None) -> Encoder:
    """Each caption its own axis, in order of appearance; pictures are a linear map of what they show. collapse: what both give instead."""
    axes: dict[str, int] = {}

    def tokenize(captions: Sequence[str]) -> np.ndarray:
        return np.array([[axes.setdefault(caption, len(axes)) % DIM] for caption in captions], np.int32)

    def encode_text(params: Array, tokens: Array) -> Array:
        return jnp.eye(DIM)[tokens[:, 0]] if collapse is None else jnp.full((len(tokens), DIM), collapse)

    def encode_image(params: Array, images: Array) -> Array:
        if collapse is not None:
            return jnp.full((len(images), DIM), collapse)
        small = jax.image.resize(images, (len(images), 4, 4, 3), "linear").reshape(len(images), -1)
        mapped = (small - 0.5) @ params
        return mapped * jax.lax.rsqrt(jnp.sum(mapped**2, axis=1, keepdims=True) + 1e-6)

    params = jnp.asarray(np.random.default_rng(1).normal(size=(48, DIM)), jnp.float32)
    return Encoder("axes", "0" * 64, SIZE, DIM, params, tokenize, encode_text, encode_image)


def seen(model: Encoder) -> np.ndarray:
    """What a model that knows every picture by heart says of the pictures of DESCRIPTIONS."""
    return examination.embed_captions(model, DESCRIPTIONS)


def test_who_knows_every_caption_ranks_it_first() -> None:
    model = encoder()
    texts = seen(model)
    np.testing.assert_array_equal(examination.ranks(texts, texts), np.zeros(5))
    np.testing.assert_array_equal(examination.hard_ranks(model, texts, DESCRIPTIONS, pool=8), np.zeros(5))


def test_ranks_count_the_captions_that_do_as_well_or_better() -> None:
    texts = np.array([[1.0, 0.0], [0.6, 0.8], [0.0, 1.0], [0.6, 0.8]])
    images = np.array([[1.0, 0.0], [0.0, 1.0], [np.nan, 0.0]])
    # The second caption is beaten by the third and tied by the fourth; of a picture that is not a number nothing is known.
    np.testing.assert_array_equal(examination.ranks(images, texts), [0, 2, 3])


@pytest.mark.parametrize("collapse", [0.125, np.nan])
def test_who_says_the_same_of_everything_finds_nothing(collapse: float) -> None:
    model = encoder(collapse)
    texts = seen(model)
    np.testing.assert_array_equal(examination.ranks(texts, texts), np.full(5, 4))
    pool = [len(pools.hard_pool(description, 8)) for description in DESCRIPTIONS]
    np.testing.assert_array_equal(examination.hard_ranks(model, texts, DESCRIPTIONS, pool=8), pool)


@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_an_attack_stays_in_its_ball_and_does_harm(radius: float) -> None:
    model = encoder()
    images = jnp.asarray(np.random.default_rng(2).uniform(0.2, 0.8, (5, 12, 12, 3)), jnp.float32)
    texts, right = jnp.asarray(seen(model)), jnp.arange(5)
    moved = examination.attack(model, images, texts, right, radius=radius)
    assert float(moved.min()) >= 0 and float(moved.max()) <= 1
    far = np.linalg.norm(np.asarray(moved - images).reshape(5, -1), axis=1)
    assert np.all(far <= radius * 1.001) and far.max() > 0.5 * radius

    def doubt(pictures: Array) -> float:
        scores = jax.nn.log_softmax(30 * model.encode_image(model.params, pictures) @ texts.T)
        return -float(scores[right, right].sum())

    assert doubt(moved) > doubt(images) + 0.1


@pytest.mark.parametrize("collapse", [None, np.nan])
def test_a_card_holds_every_share_and_a_broken_model_earns_none(collapse: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "POOL", 6)
    monkeypatch.setattr(report, "timings", lambda encoder: {})
    card = report.examine(encoder(collapse), pools=2, radii=(0.5,))
    for label in ("taught combinations", "held-out combinations"):
        assert card[label]["pictures"] == 12
        shares = [card[label][name][0] for name in ("R@1", "R@5", "R@1 hard")]
        assert all(0 <= share <= 1 for share in shares) and shares[0] <= shares[1]
        assert collapse is None or shares == [0, 0, 0]
    assert collapse is None or card["under attack"] == {"0.5": [0, 0]}
    assert set(card["by form"]) <= {"plain", "size", "pattern", "part", *words.RELATIONS}


@pytest.mark.parametrize(
    ("caption", "form"),
    [("a red mug", "plain"), ("a large red mug", "size"), ("a striped red mug", "pattern"), ("a red mug next to a blue egg", "next to")],
)
def test_the_form_of_a_caption(caption: str, form: str) -> None:
    assert report.form_of(parse(caption)) == form


def test_a_share_has_the_error_of_its_mean() -> None:
    assert report.share(np.array([True, False, True, True])) == [0.75, 0.25]

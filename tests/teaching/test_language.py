"""Captions say what they mean: there and back, the same every time, and the held-out ones stay out."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.teaching import pools, words
from dreamfields_core.teaching.language import Description, Thing, describe, paraphrase, parse


def test_every_paraphrase_parses_back() -> None:
    rng = np.random.default_rng(0)
    for _ in range(1500):
        description = pools.random_description(rng, held_out=None)
        assert parse(paraphrase(rng, description)) == description
        assert parse(describe(description)) == description


@pytest.mark.parametrize(
    ("caption", "description"),
    [
        ("A red mug.", Description(Thing("mug", "red"))),
        ("a photo of a polka dot violet donut", Description(Thing("torus", "purple", "dotted"))),
        ("a cube with a green cone on top", Description(Thing("cone", "green"), "on top of", Thing("cube"))),
        ("a red box under an egg", Description(Thing("egg"), "on top of", Thing("cube", "red"))),
        ("an ice cream with a pink cone", Description(Thing("ice cream", part_color="pink"))),
        ("a car that is blue that has wheels that are red", Description(Thing("car", "blue", part_color="red"))),
        ("a white egg beside a brown dish", Description(Thing("egg", "white"), "next to", Thing("bowl", "brown"))),
    ],
)
def test_captions_by_hand(caption: str, description: Description) -> None:
    assert parse(caption) == description


@pytest.mark.parametrize("caption", ["a red dragon", "red", "", "a red blue mug", "a sphere with a red roof", "a mug with a handle"])
def test_what_the_language_cannot_say_is_refused_in_one_sentence(caption: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        parse(caption)


def test_the_vocabulary_holds_every_word_of_every_caption() -> None:
    rng, known = np.random.default_rng(1), set(words.vocabulary())
    said = {word for _ in range(2000) for word in words.split(paraphrase(rng, pools.random_description(rng, held_out=None)))}
    assert said <= known


def test_no_lesson_holds_what_is_held_out() -> None:
    rng = np.random.default_rng(2)
    assert not any(pools.is_held_out(pools.random_description(rng)) for _ in range(1000))
    assert all(pools.is_held_out(pools.random_description(rng, held_out=True)) for _ in range(50))


def test_what_is_held_out_is_not_taught_under_its_other_name() -> None:
    rng = np.random.default_rng(6)
    drawn = [pools.random_description(rng, held_out=True) for _ in range(2000)]
    beside = [d for d in drawn if d.relation == "next to"]
    assert beside and all(pools.is_held_out(Description(d.other, d.relation, d.thing)) for d in beside if d.other)


def test_about_an_eighth_is_held_out_by_a_hash_that_never_changes() -> None:
    plain = [Description(Thing(kind, color)) for kind in words.KINDS for color in words.COLORS]
    held_out = [describe(d) for d in plain if pools.is_held_out(d)]
    assert 0.08 < len(held_out) / len(plain) < 0.16
    assert held_out[:3] == ["an orange sphere", "a pink sphere", "a brown sphere"]


def test_the_same_seed_says_the_same() -> None:
    first, second = ([paraphrase(rng, pools.random_description(rng)) for _ in range(50)] for rng in map(np.random.default_rng, (3, 3)))
    assert first == second


def test_a_hard_negative_means_something_else() -> None:
    rng = np.random.default_rng(4)
    for _ in range(500):
        description = pools.random_description(rng, held_out=None)
        assert pools.meaning(pools.hard_negative(rng, description)) != pools.meaning(description)


def test_a_hard_pool_keeps_colours_and_changes_kinds() -> None:
    target = parse("a striped red mug")
    pool = pools.hard_pool(target, 30)
    assert len({pools.meaning(d) for d in pool}) == 30
    assert all((d.thing.color, d.thing.pattern) == ("red", "striped") and d.thing.kind != "mug" for d in pool)


def test_a_random_pool_has_no_meaning_twice() -> None:
    pool = pools.random_pool(np.random.default_rng(5), 153)
    assert len({pools.meaning(d) for d in pool}) == 153


def test_next_to_reads_the_same_both_ways() -> None:
    assert pools.meaning(parse("a red mug next to a blue egg")) == pools.meaning(parse("a blue egg next to a red mug"))
    assert pools.meaning(parse("a red mug on top of a blue cube")) != pools.meaning(parse("a blue cube on top of a red mug"))

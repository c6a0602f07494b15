"""Names that every file system takes."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flows.slugs import plain_name, slug

RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(10))}
KEY = "0123456789abcdef" * 4


@given(st.text(max_size=300))
def test_any_caption_gives_a_short_plain_name(caption: str) -> None:
    name = slug(caption, KEY)
    assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name) and len(name) <= 80 and name == name.lower()
    assert name.split(".")[0] not in RESERVED and name.endswith("-0123456789ab")


@pytest.mark.parametrize("caption", [*sorted(RESERVED), "CON", "Aux.", "..", "/", "\\", "", "красный гриб", "🍄", "~", "a" * 500])
def test_what_a_system_reserves_or_cannot_write_is_named_apart(caption: str) -> None:
    name = slug(caption, KEY)
    assert name not in RESERVED and re.fullmatch(r"[a-z0-9-]{14,80}", name)


def test_names_that_differ_in_case_or_accents_only_are_kept_apart_by_their_keys() -> None:
    names = {slug(caption, key * 64) for caption, key in (("A Red Mug", "a"), ("a red mug", "b"), ("a réd mug", "c"))}
    assert len({name.lower() for name in names}) == 3 and all(name.startswith("a-red-mug-") for name in names)


def test_a_name_is_stable() -> None:
    assert slug("A castle, made of cheese!", KEY) == "a-castle-made-of-cheese-0123456789ab"


def test_a_folder_is_named_by_the_words_without_their_accents() -> None:
    assert plain_name("Un Café, crème!") == "un-cafe-creme"
    assert plain_name("кот") == "dream"
    assert plain_name("a" * 47 + " tree") == "a" * 47

"""Captions that can be dreamed, those that cannot, and how retrieval writes them."""

from __future__ import annotations

import pytest

from dreamfields_core.captions import LONGEST, CaptionError, check, normalize


@pytest.mark.parametrize(
    ("caption", "written"),
    [
        ("A red Mug", "a red mug."),
        ("a red mug.", "a red mug."),
        (" a red mug , .", "a red mug."),
        ("a red mug, on a table.", "a red mug, on a table."),
        ("...", "."),
        ("", "."),
        ("ÉTÉ", "été."),
    ],
)
def test_as_the_pool_holds_it(caption: str, written: str) -> None:
    assert normalize(caption) == written
    assert normalize(written) == written


@pytest.mark.parametrize("caption", ["a red mug", "  a red mug\n", "x" * LONGEST, "日本の茶碗", "\u200d" + "emoji 🫖"])
def test_good_captions_keep_their_words(caption: str) -> None:
    assert check(caption) == caption.strip()


@pytest.mark.parametrize(
    ("caption", "sentence"),
    [
        ("", "got an empty one"),
        (" \n\t ", "got an empty one"),
        ("x" * 10_000, f"at most {LONGEST} characters, got 10000"),
        ("a\nmug", "on one line without control characters"),
        ("a\x00mug", "on one line without control characters"),
        ("a\x1b[31mmug", "on one line without control characters"),
    ],
)
def test_bad_captions_are_refused_in_one_sentence(caption: str, sentence: str) -> None:
    with pytest.raises(CaptionError) as refused:
        check(caption)
    assert sentence in str(refused.value) and "\n" not in str(refused.value)

"""Captions to tokens [batch, length] int32: what all tokenizers share, the cutting of what is too long among it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np

Tokenize = Callable[[Sequence[str]], np.ndarray]


class CaptionCut(UserWarning):
    """A caption is longer than the model reads; the text says after which words it is cut."""


Pieces = tuple[list[int], list[str]]
"""Ids of a caption's tokens without the special ones, and the text that each stands for."""


def padded(
    split: Callable[[str], Pieces],
    *,
    name: str,
    length: int,
    before: tuple[int, ...] = (),
    after: tuple[int, ...] = (),
    padding: int = 0,
) -> Tokenize:
    """A tokenizer that frames, cuts and pads what `split` finds.

    Args:
      split: caption -> its tokens.
      name: of the model, for the warning.
      length: tokens of every result.
      before, after: ids that always stand around a caption; a caption that is too long is cut so that they stay.
      padding: id that fills the rest.
    """
    room = length - len(before) - len(after)

    def one(caption: str) -> list[int]:
        if not isinstance(caption, str):
            raise TypeError(f"expected captions as text, got {type(caption).__name__}: pass a list of strings")
        ids, texts = split(caption)
        if len(ids) > room:
            kept = "".join(texts[:room]).strip()
            message = f'{name} reads {room} tokens and this caption has {len(ids)}: it is cut after "...{kept[-40:]}"'
            warnings.warn(message, CaptionCut, stacklevel=3)
        row = [*before, *ids[:room], *after]
        return row + [padding] * (length - len(row))

    def tokenize(captions: Sequence[str]) -> np.ndarray:
        if isinstance(captions, str):
            raise TypeError("expected a list of captions, got one string: put it in brackets")
        return np.array([one(caption) for caption in captions], np.int32).reshape(len(captions), length)

    return tokenize

"""Captions to tokens [batch, length] int32: what all tokenizers share, the cutting of what is too long among it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np

Tokenize = Callable[[Sequence[str]], np.ndarray]
SHOWN = 40
"""Characters of a caption that the warning repeats, at most, before the place where it is cut."""


class CaptionCut(UserWarning):
    """A caption is longer than the model reads; the text says after which words it is cut."""


def _warn(sentence: str) -> None:
    warnings.warn(sentence, CaptionCut, stacklevel=5)


_tell: ContextVar[Callable[[str], None]] = ContextVar("who is told of a caption that is cut", default=_warn)


@contextmanager
def cuts_told(tell: Callable[[str], None]) -> Iterator[None]:
    """Within, `tell` gets the sentence about each caption that is cut, instead of Python's warnings."""
    before = _tell.set(tell)
    try:
        yield
    finally:
        _tell.reset(before)


def tell_cut(name: str, parts: str, *, reads: int, has: int, kept: str) -> None:
    """Say that a model reads so many parts (tokens, words) of a caption that has more, and what it keeps."""
    _tell.get()(f'{name} reads {reads} {parts} and this caption has {has}: it is cut after "{_end(kept)}"')


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
            tell_cut(name, "tokens", reads=room, has=len(ids), kept="".join(texts[:room]).strip())
        row = [*before, *ids[:room], *after]
        return row + [padding] * (length - len(row))

    def tokenize(captions: Sequence[str]) -> np.ndarray:
        if isinstance(captions, str):
            raise TypeError("expected a list of captions, got one string: put it in brackets")
        return np.array([one(caption) for caption in captions], np.int32).reshape(len(captions), length)

    return tokenize


def _end(text: str) -> str:
    """The last words of a text."""
    if len(text) <= SHOWN:
        return text
    tail = text[-SHOWN:]
    return f"... {tail.partition(' ')[2] or tail}"

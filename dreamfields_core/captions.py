"""Captions: what may be dreamed, and how retrieval writes it (paper section 5.1)."""

from __future__ import annotations

import unicodedata

LONGEST = 1000
"""Characters; several times what any supported text encoder reads."""


class CaptionError(ValueError):
    """A caption that cannot be dreamed; its text is one sentence with the way out."""


def check(caption: str) -> str:
    """The caption, with surrounding white space removed.

    Raises:
      CaptionError: empty, too long, or with control characters.
    """
    stripped = caption.strip()
    if not stripped:
        raise CaptionError('expected a caption such as "a red mug", got an empty one')
    if len(stripped) > LONGEST:
        raise CaptionError(f"expected a caption of at most {LONGEST} characters, got {len(stripped)}: shorten it to what should be seen")
    if any(unicodedata.category(character) == "Cc" for character in stripped):
        raise CaptionError("expected a caption on one line without control characters: remove line breaks and tabs")
    return stripped


def normalize(caption: str) -> str:
    """As retrieval pools hold it: lower case, no spaces, dots or commas at either end, one final dot."""
    return caption.lower().strip(" .,") + "."

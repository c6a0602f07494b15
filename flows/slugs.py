"""Names of objects for every file system: ASCII, short, and never equal but for their case."""

from __future__ import annotations

import re
import unicodedata

LONGEST = 80
DIGITS = 12
"""Of the key: two objects of one caption share a name once in 10^14."""


def plain_name(text: str, *, longest: int = 48) -> str:
    """Of a text so much as every file system takes: a-z, 0-9 and "-", accents dropped; "dream" where nothing is left."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:longest].strip("-") or "dream"


def slug(caption: str, key: str) -> str:
    """At most 80 of a-z, 0-9 and "-": the caption's words, as far as they are Latin, and the beginning of a hexadecimal key.

    The key's digits keep names apart that differ in case or accents only, and from Windows' own (con, nul, com1), which stand alone.
    """
    return f"{plain_name(caption, longest=LONGEST - DIGITS - 1)}-{key[:DIGITS].lower()}"

"""All kinds of the language by name: (rng) -> parts."""

from __future__ import annotations

from dreamfields_core.teaching import solids_household, solids_outdoors, solids_shapes, words
from dreamfields_core.teaching.parts import BODY, KINDS, PART

__all__ = ["BODY", "KINDS", "PART", "solids_household", "solids_outdoors", "solids_shapes"]

if set(KINDS) != set(words.KINDS):
    raise RuntimeError(f"expected a solid for every word, got a difference of {sorted(set(KINDS) ^ set(words.KINDS))}: add what is missing")

"""Which pictures a step shows, and what is said of them: all of it follows from (seed, step)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dreamfields_core.guidance import embedded
from dreamfields_core.guidance.towers import Architecture
from dreamfields_core.teaching import words
from dreamfields_core.teaching.album import descriptions_of, facts
from dreamfields_core.teaching.language import Description, paraphrase
from dreamfields_core.teaching.pools import hard_negative, meaning
from dreamfields_core.teaching.terms import Course, Term


class Batch(NamedTuple):
    """pictures: uint8 [B, size, size, 4]. tokens, wrong: [B, length]. meaning, wrong_meaning: [B]. facts: [B, questions]."""

    pictures: np.ndarray
    tokens: np.ndarray
    wrong: np.ndarray
    meaning: np.ndarray
    wrong_meaning: np.ndarray
    facts: np.ndarray


class Class:
    """The captioned pictures of a course, and the batch of any step."""

    def __init__(self, course: Course, pictures: np.ndarray, captions: Sequence[str], architecture: Architecture):
        self.course, self.pictures = course, pictures
        self.descriptions = descriptions_of(captions)
        self.facts = np.stack([facts(description) for description in self.descriptions])
        looks = [look(description) for description in self.descriptions]
        number = {name: i for i, name in enumerate(dict.fromkeys(looks))}
        self.look = np.array([number[name] for name in looks])
        order = np.argsort(self.look, kind="stable")
        self.two = np.flatnonzero([description.other is not None for description in self.descriptions])
        self.alike = np.split(order, np.cumsum(np.bincount(self.look))[:-1])
        self.tokenize = embedded.tokenizer(words.vocabulary(), architecture.length)
        self.length = architecture.length

    def batch(self, step: int) -> Batch:
        """The batch of a step; in robust lessons the same one for `replays` steps."""
        course = self.course
        term, number = course.term_of(step)
        lesson = step - number % course.replays if term.radius else step
        rng = np.random.default_rng([course.seed, 7, lesson])
        chosen = self._choose(rng, term)
        said = [self.descriptions[i] for i in chosen]
        wrong = [hard_negative(rng, description) for description in said]
        return Batch(
            self.pictures[chosen],
            self.tokenize([self._caption(rng, description) for description in said]),
            self.tokenize([self._caption(rng, description) for description in wrong]),
            np.array([fingerprint(description) for description in said], np.int32),
            np.array([fingerprint(description) for description in wrong], np.int32),
            self.facts[chosen],
        )

    def _choose(self, rng: np.random.Generator, term: Term) -> np.ndarray:
        """Which pictures a batch shows, [B]: groups of `term.alike` that share all but the kinds, as far as there are so many."""
        chosen = rng.integers(len(self.pictures), size=self.course.batch)
        for start in range(0, len(chosen), term.alike):
            if term.pairs and rng.random() < term.pairs and len(self.two):
                chosen[start] = rng.choice(self.two)
            group = self.alike[self.look[chosen[start]]]
            count = min(term.alike, len(chosen) - start)
            if term.alike > 1 and len(group) >= count:
                chosen[start : start + count] = rng.choice(group, count, replace=False)
        return chosen

    def _caption(self, rng: np.random.Generator, description: Description) -> str:
        """A paraphrase short enough to be read whole."""
        while True:
            caption = paraphrase(rng, description)
            if len(embedded.words_of(caption)) <= self.length:
                return caption


def look(description: Description) -> tuple:
    """All that a caption says but kinds and size."""
    things = [(t.color, t.pattern, t.part_color) for t in (description.thing, description.other) if t]
    return (description.relation, *things)


def fingerprint(description: Description) -> int:
    """A number that captions of the same meaning share, and hardly any others."""
    return int.from_bytes(hashlib.sha256(repr(meaning(description)).encode()).digest()[:4], "big") >> 1

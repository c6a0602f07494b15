"""What a course is: terms of so many steps, each with its rate, its adversary and its choice of pictures."""

from __future__ import annotations

import bisect
import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Term:
    """Steps that belong together; a term begins with what the one before would ship, and a fresh optimiser.

    rate: after `warm` steps; it falls to `last` times itself, a cosine.
    radius: of the L2 ball in pixel values that pictures are moved in, reached after `ramp` steps; 0 for plain lessons.
    clean: share of the pictures that an adversarial term leaves where they are.
    alike: pictures of a batch that share colours, pattern and relation with one another, so that only the kind tells them apart.
    pairs: share of these groups that show two things at once, whose kinds are the hardest to tell; 0 takes them as often as they come.
    """

    steps: int
    rate: float
    radius: float = 0.0
    ramp: int = 1
    clean: float = 0.0
    alike: int = 1
    pairs: float = 0.0
    last: float = 0.01
    warm: int = 100


@dataclass(frozen=True)
class Course:
    """What makes a model what it is.

    seed: of weights, batches and pictures; two courses with different seeds share no picture.
    sizes: fields of `Architecture`.
    pages: of the album, 1 024 pictures each.
    replays: how often a batch of an adversarial term is seen, each counting as a step.
    """

    seed: int
    terms: tuple[Term, ...]
    sizes: Mapping[str, Any] = field(default_factory=dict)
    pages: int = 64
    batch: int = 64
    replays: int = 3
    averaging: float = 0.998
    facts_weight: float = 1.0

    @property
    def starts(self) -> tuple[int, ...]:
        """The first step of each term, and the end."""
        return (0, *np.cumsum([term.steps for term in self.terms]).tolist())

    @property
    def steps(self) -> int:
        return self.starts[-1]

    def term_of(self, step: int) -> tuple[Term, int]:
        """The term that a step belongs to, and the step's number in it."""
        number = bisect.bisect_right(self.starts, step, hi=len(self.terms)) - 1
        return self.terms[number], step - self.starts[number]

    def taught_by(self, step: int) -> str:
        """sha256, in hexadecimal, of what the first `step` steps depend on but the pictures; terms that have not begun may still change."""
        begun = bisect.bisect_left(self.starts, step, hi=len(self.terms))
        lasting = {name: value for name, value in asdict(self).items() if name not in ("pages", "terms")}
        terms = [asdict(term) for term in self.terms[:begun]]
        return hashlib.sha256(json.dumps([lasting, terms], sort_keys=True).encode()).hexdigest()

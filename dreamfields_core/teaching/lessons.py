"""A course: its terms, its steps, its state. Randomness follows from (seed, step), so that a resumed course is the same course.

Plain terms come first, then 'free' adversarial ones (Shafahi et al. 2019): each batch is replayed, and the gradient that teaches also
moves the pictures to where the model errs. Robust encoders give gradients that look like objects.
"""

from __future__ import annotations

import bisect
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from dreamfields_core.guidance import embedded
from dreamfields_core.guidance.towers import Architecture, read, see
from dreamfields_core.teaching import contrast, words
from dreamfields_core.teaching.album import descriptions_of, facts
from dreamfields_core.teaching.language import Description, paraphrase
from dreamfields_core.teaching.pools import hard_negative, meaning
from dreamfields_core.teaching.spoiling import junk, spoil
from dreamfields_core.types import Array, Params


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


class Batch(NamedTuple):
    """pictures: uint8 [B, size, size, 4]. tokens, wrong: [B, length]. meaning, wrong_meaning: [B]. facts: [B, questions]."""

    pictures: np.ndarray
    tokens: np.ndarray
    wrong: np.ndarray
    meaning: np.ndarray
    wrong_meaning: np.ndarray
    facts: np.ndarray


class Progress(NamedTuple):
    """All that a course needs to go on. perturbation: [B, size, size, 3]."""

    step: Array
    params: Params
    average: Params
    optimizer: Any
    perturbation: Array


def begin(course: Course) -> tuple[embedded.Model, Progress]:
    """The untaught model and the state before the first step."""
    model_key, question_key = jax.random.split(jax.random.key(course.seed))
    model = embedded.create(model_key, words.vocabulary(), **course.sizes)
    params = {"model": model.params, "questions": contrast.init_questions(question_key, model.architecture.dim)}
    size = model.architecture.image_size
    perturbation = jnp.zeros((course.batch, size, size, 3))
    return model, Progress(jnp.int32(0), params, params, _optimizer().init(params), perturbation)


def _optimizer(weight_decay: float = 0.01) -> optax.GradientTransformation:
    """Clipped AdamW, of which the rate is yet to be taken."""
    return optax.chain(optax.clip_by_global_norm(1.0), optax.scale_by_adam(b2=0.99), optax.add_decayed_weights(weight_decay))


def rate_of(course: Course) -> optax.Schedule:
    """The rate by the step of the course: each term warms up, then falls along a cosine."""
    rates = [
        optax.warmup_cosine_decay_schedule(0.0, t.rate, min(t.warm, t.steps // 10 + 1), t.steps, t.last * t.rate) for t in course.terms
    ]
    return optax.join_schedules(rates, list(course.starts[1:-1]))


def radius_of(course: Course) -> optax.Schedule:
    """The radius of the adversarial pictures by the step of the course."""
    radii = [optax.linear_schedule(0.0, term.radius, term.ramp) for term in course.terms]
    return optax.join_schedules(radii, list(course.starts[1:-1]))


def begin_term(course: Course, step: int, model: Params) -> Progress:
    """The state before a term's first step, with these weights as they ship, in half precision: whoever has the file can go on from it."""
    params = {"model": jax.tree.map(lambda leaf: leaf.astype(jnp.float16).astype(jnp.float32), model)}
    fresh = begin(course)[1]
    params["questions"] = fresh.params["questions"]
    return fresh._replace(step=jnp.int32(step), params=params, average=params)


def enter_term(course: Course, progress: Progress) -> Progress:
    """What a term begins with, where this step is a term's first. Else the progress as it is."""
    if int(progress.step) not in course.starts[1:-1]:
        return progress
    return begin_term(course, int(progress.step), progress.average["model"])


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


def make_step(course: Course, architecture: Architecture) -> Callable[[Progress, Batch], tuple[Progress, dict[str, Array]]]:
    """The compiled step: (progress, batch) -> (progress, what to report)."""
    optimizer, rate, radius = _optimizer(), rate_of(course), radius_of(course)
    starts = jnp.array(course.starts[:-1])
    clean = jnp.array([term.clean for term in course.terms])
    replays = jnp.array([course.replays if term.radius else 1 for term in course.terms])

    def loss(params: Params, images: Array, junk_key: Array, batch: Batch) -> tuple[Array, dict[str, Array]]:
        model = params["model"]
        pictures = jnp.concatenate([images, junk(junk_key, images[: course.batch // 8])])
        seen = see(model, pictures, architecture)
        seen, odd = seen[: course.batch], seen[course.batch :]
        texts = read(model, jnp.concatenate([batch.tokens, batch.wrong]), architecture)
        right, wrong = jnp.split(texts, 2)
        apart = contrast.contrast(seen, right, wrong, odd, batch.meaning, batch.wrong_meaning, model["log_scale"])
        unknown = contrast.ignorance(params["questions"], seen, batch.facts) + 0.5 * contrast.ignorance(
            params["questions"], right, batch.facts
        )
        hits = jnp.mean(jnp.argmax(seen @ texts.T, 1) == jnp.arange(course.batch))
        return apart + course.facts_weight * unknown, {"contrast": apart, "facts": unknown, "hits": hits}

    @jax.jit
    def step(progress: Progress, batch: Batch) -> tuple[Progress, dict[str, Array]]:
        number = progress.step
        term = jnp.searchsorted(starts, number, side="right") - 1
        replay = (number - starts[term]) % replays[term]
        key = jax.random.fold_in(jax.random.key(course.seed, impl="unsafe_rbg"), number - replay)
        pictures = jnp.asarray(batch.pictures, jnp.float32) / 255
        spoiled = spoil(key, pictures)
        perturbation = jnp.where(replay > 0, progress.perturbation, 0)
        images = jnp.clip(spoiled + perturbation, 0, 1)
        gradient = jax.grad(loss, argnums=(0, 1), has_aux=True)
        (slope, image_slope), report = gradient(progress.params, images, jax.random.fold_in(key, 1), batch)
        updates, state = optimizer.update(slope, progress.optimizer, progress.params)
        params = jax.tree.map(lambda p, u: p - rate(number) * u, progress.params, updates)
        keep = jnp.minimum(course.averaging, (1.0 + number) / (10.0 + number))
        average = jax.tree.map(lambda a, p: keep * a + (1 - keep) * p, progress.average, params)
        moved = jax.random.uniform(jax.random.fold_in(key, 2), (course.batch, 1, 1, 1)) >= clean[term]
        perturbation = contrast.toward_ball(perturbation, image_slope, radius(number) * moved)
        return Progress(number + 1, params, average, state, perturbation), report

    return step


def taught(model: embedded.Model, progress: Progress) -> embedded.Model:
    """The model with the averaged weights."""
    return embedded.Model(model.architecture, model.vocabulary, progress.average["model"])

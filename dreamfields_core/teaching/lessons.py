"""A course: its batches, its steps, its state. Randomness follows from (seed, step), so that a resumed course is the same course.

Plain lessons come first, then 'free' adversarial ones (Shafahi et al. 2019): each batch is replayed, and the gradient that teaches also
moves the pictures to where the model errs. Robust encoders give gradients that look like objects.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
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
class Course:
    """What makes a model what it is.

    seed: of weights, batches and pictures; two courses with different seeds share no picture.
    sizes: fields of `Architecture`.
    pages: of the album, 1 024 pictures each.
    plain_steps: batches seen as they are.
    robust_terms: (steps, rate) of each term of robust lessons; the rate falls to nothing within a term, a cosine.
        A batch is seen `replays` times, each counting as a step.
    radius: of the L2 ball in pixel values, ramped in over the first third of the first robust term.
    learning_rate: of the plain lessons, after a warm-up; it would fall to nothing at step `horizon`, a cosine.
    """

    seed: int
    sizes: Mapping[str, Any] = field(default_factory=dict)
    pages: int = 40
    batch: int = 64
    plain_steps: int = 3000
    robust_terms: tuple[tuple[int, float], ...] = ((3000, 1e-3),)
    replays: int = 3
    radius: float = 1.0
    learning_rate: float = 2e-3
    horizon: int = 6000
    averaging: float = 0.998
    facts_weight: float = 1.0

    @property
    def steps(self) -> int:
        return self.plain_steps + sum(steps for steps, _ in self.robust_terms)


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
    return model, Progress(jnp.int32(0), params, params, _optimizer(course).init(params), perturbation)


def _optimizer(course: Course) -> optax.GradientTransformation:
    warm = min(150, course.horizon // 10 + 1)
    plain = optax.warmup_cosine_decay_schedule(0.0, course.learning_rate, warm, course.horizon, 0.01 * course.learning_rate)
    robust = [optax.cosine_decay_schedule(rate, steps, 0.01) for steps, rate in course.robust_terms]
    starts = np.cumsum([course.plain_steps, *(steps for steps, _ in course.robust_terms)])[:-1]
    rate = optax.join_schedules([plain, *robust], [int(start) for start in starts])
    return optax.chain(optax.clip_by_global_norm(1.0), optax.adamw(rate, b2=0.99, weight_decay=0.01))


class Class:
    """The captioned pictures of a course, and the batch of any step."""

    def __init__(self, course: Course, pictures: np.ndarray, captions: Sequence[str], architecture: Architecture):
        self.course, self.pictures = course, pictures
        self.descriptions = descriptions_of(captions)
        self.facts = np.stack([facts(description) for description in self.descriptions])
        self.tokenize = embedded.tokenizer(words.vocabulary(), architecture.length)
        self.length = architecture.length

    def batch(self, step: int) -> Batch:
        """The batch of a step; in robust lessons the same one for `replays` steps."""
        course = self.course
        lesson = step if step < course.plain_steps else step - (step - course.plain_steps) % course.replays
        rng = np.random.default_rng([course.seed, 7, lesson])
        chosen = rng.integers(len(self.pictures), size=course.batch)
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

    def _caption(self, rng: np.random.Generator, description: Description) -> str:
        """A paraphrase short enough to be read whole."""
        while True:
            caption = paraphrase(rng, description)
            if len(embedded.words_of(caption)) <= self.length:
                return caption


def fingerprint(description: Description) -> int:
    """A number that captions of the same meaning share, and hardly any others."""
    return int.from_bytes(hashlib.sha256(repr(meaning(description)).encode()).digest()[:4], "big") >> 1


def make_step(course: Course, architecture: Architecture) -> Callable[[Progress, Batch], tuple[Progress, dict[str, Array]]]:
    """The compiled step: (progress, batch) -> (progress, what to report)."""
    optimizer = _optimizer(course)
    ramp = course.robust_terms[0][0] / 3 + 1 if course.robust_terms else 1.0

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
        into_robust = number - course.plain_steps
        replay = jnp.where(into_robust >= 0, into_robust % course.replays, 0)
        key = jax.random.fold_in(jax.random.key(course.seed, impl="unsafe_rbg"), number - replay)
        pictures = jnp.asarray(batch.pictures, jnp.float32) / 255
        clean = spoil(key, pictures)
        radius = course.radius * jnp.clip(into_robust / ramp, 0, 1)
        perturbation = jnp.where(replay > 0, progress.perturbation, 0)
        images = jnp.clip(clean + perturbation, 0, 1)
        gradient = jax.grad(loss, argnums=(0, 1), has_aux=True)
        (slope, image_slope), report = gradient(progress.params, images, jax.random.fold_in(key, 1), batch)
        updates, state = optimizer.update(slope, progress.optimizer, progress.params)
        params = optax.apply_updates(progress.params, updates)
        keep = jnp.minimum(course.averaging, (1.0 + number) / (10.0 + number))
        average = jax.tree.map(lambda a, p: keep * a + (1 - keep) * p, progress.average, params)
        perturbation = contrast.toward_ball(perturbation, image_slope, radius)
        return Progress(number + 1, params, average, state, perturbation), report

    return step


def taught(model: embedded.Model, progress: Progress) -> embedded.Model:
    """The model with the averaged weights."""
    return embedded.Model(model.architecture, model.vocabulary, progress.average["model"])

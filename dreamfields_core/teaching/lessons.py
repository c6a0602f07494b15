"""The steps of a course and its state. Randomness follows from (seed, step), so that a resumed course is the same course.

Plain terms come first, then 'free' adversarial ones (Shafahi et al. 2019): each batch is replayed, and the gradient that teaches also
moves the pictures to where the model errs. Robust encoders give gradients that look like objects.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax

from dreamfields_core.guidance import embedded
from dreamfields_core.guidance.towers import Architecture, read, see
from dreamfields_core.teaching import contrast, words
from dreamfields_core.teaching.batches import Batch
from dreamfields_core.teaching.spoiling import junk, spoil
from dreamfields_core.teaching.terms import Course
from dreamfields_core.types import Array, Params


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
    fresh = begin(course)[1]
    params = fresh.params | {"model": jax.tree.map(lambda leaf: leaf.astype(jnp.float16).astype(jnp.float32), model)}
    return fresh._replace(step=jnp.int32(step), params=params, average=params)


def enter_term(course: Course, progress: Progress) -> Progress:
    """What a term begins with, where this step is a term's first. Else the progress as it is."""
    if int(progress.step) not in course.starts[1:-1]:
        return progress
    return begin_term(course, int(progress.step), progress.average["model"])


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

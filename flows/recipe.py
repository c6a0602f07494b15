"""From a caption to an object: which step follows which. The only place where the steps are wired, whoever conducts them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

from dreamfields_core.config import DreamConfig
from flows.beside import Beside
from storage.artifacts import ArtifactRef
from tasks.encoders import card
from tasks.step import Done, Input, Place, Step, is_done, perform
from tasks.steps import ENCODE, MESH, MESH_SCORE, OPTIMIZE, RENDER, SCORE, VIEWS


@dataclass(frozen=True)
class Score:
    """What a judge says of the field, and of its mesh if there is one."""

    field: Done
    mesh: Done | None

    @property
    def values(self) -> dict[str, Any]:
        """Of both."""
        return self.field.record.values | (self.mesh.record.values if self.mesh else {})


@dataclass(frozen=True)
class Dream:
    """What was done for one caption, step by step. pictures, mesh: None where only a score was wanted. scores: by judge, the
    configuration's own first."""

    words: Done
    field: Done
    views: Done
    pictures: Done | None
    mesh: Done | None
    scores: dict[str, Score]

    @property
    def score(self) -> Score:
        """By the judge that the configuration names."""
        return next(iter(self.scores.values()))

    @property
    def steps(self) -> tuple[Done, ...]:
        """In the order of the recipe."""
        wanted = (self.words, self.field, self.views, self.pictures, self.mesh, self.score.field, self.score.mesh)
        return tuple(done for done in wanted if done)


class Conductor(Protocol):
    """Who has the steps done, for one configuration."""

    def __call__(self, step: Step, **inputs: Input) -> Done:
        """Do a step now, on this thread, so that signals reach it."""

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        """Begin a step beside others; call what comes back for its result."""

    def has(self, step: Step, **inputs: Input) -> bool:
        """Whether the step is done already."""

    def under(self, config: DreamConfig) -> Conductor:
        """The same for another configuration."""


STEPS = (ENCODE, OPTIMIZE, VIEWS, RENDER, MESH, SCORE, MESH_SCORE)
"""All that a dream may be made of."""


def make_object(
    conduct: Conductor,
    caption: str,
    config: DreamConfig,
    *,
    pool: ArtifactRef | None = None,
    judges: Sequence[str] = (),
    score_only: bool = False,
) -> Dream:
    """Encode the caption, optimise a field for it, render and mesh the field side by side, and score what came out.

    pool: captions that the judge chooses from, where the usual ones do not fit (tasks/pools.py). judges: further ones.
    score_only: what a table reports, the field's score, needs neither pictures nor a mesh: none are made. Where both are there already,
    they stay the object's, and the mesh is scored too.
    """
    guide, judge = card(config.guidance.name), card(config.evaluate.judge)
    words = conduct(ENCODE, caption=caption, guide=guide.digest)
    dreamt = conduct(OPTIMIZE, text_embedding=words.output("text_embedding.npy"), guide=guide.digest)
    field = dreamt.output("field.safetensors")
    shown: dict[str, Input] = {"field": field, "caption": caption}
    meshed = shown | {"guide": guide.digest}
    score_only = score_only and not (conduct.has(RENDER, **shown) and conduct.has(MESH, **meshed))
    rendering = None if score_only else conduct.start(RENDER, **shown)
    try:
        views = conduct(VIEWS, field=field, size=config.evaluate.size or judge.image_size)
        mesh = None if score_only else conduct(MESH, **meshed)
    except Exception:
        if rendering:  # it would go on beside the next object, or crash an interpreter that ends
            with suppress(Exception):
                rendering()
        raise
    pictures = rendering() if rendering else None
    glimpses, glb = dreamt.output("glimpses.npz"), mesh.output("mesh.glb") if mesh else None
    made = Remains(caption, field, views.output("views.npz"), glimpses, glb, pool)
    scores = {name: judge_object(conduct, made, config, name) for name in dict.fromkeys([judge.name, *judges])}
    return Dream(words, dreamt, views, pictures, mesh, scores)


@dataclass(frozen=True)
class Remains:
    """What of an object a judge needs. views: at the size of the judge that the object's configuration names. glimpses: of the field on the
    way, where they were taken."""

    caption: str
    field: ArtifactRef
    views: ArtifactRef
    glimpses: ArtifactRef | None = None
    mesh: ArtifactRef | None = None
    pool: ArtifactRef | None = None


def judge_object(conduct: Conductor, made: Remains, config: DreamConfig, name: str) -> Score:
    """The score by a judge, from views of the size that it wants: those there are, or else further ones of the same field."""
    judge, size = card(name), config.evaluate.size
    conduct = conduct.under(judged_by(config, name))
    views = made.views
    if size is None and judge.image_size != card(config.evaluate.judge).image_size:
        views = conduct(VIEWS, field=made.field, size=judge.image_size).output("views.npz")
    shared: dict[str, Input] = {"views": views, "caption": made.caption, "judge": judge.digest}
    shared |= {"pool": made.pool} if made.pool else {}
    field = conduct(SCORE, **shared, **({"glimpses": made.glimpses} if made.glimpses else {}))
    return Score(field, conduct(MESH_SCORE, mesh=made.mesh, **shared) if made.mesh else None)


def judged_by(config: DreamConfig, name: str) -> DreamConfig:
    """The same with another judge."""
    return config.model_copy(update={"evaluate": config.evaluate.model_copy(update={"judge": name})})


class Plainly:
    """Conducts without any server: the steps are simply called."""

    def __init__(self, place: Place, config: DreamConfig) -> None:
        self._place, self._config = place, config

    def __call__(self, step: Step, **inputs: Input) -> Done:
        self._place.report({"event": "begin", "name": step.name})
        done = perform(step, self._place, self._config, inputs)
        self._place.report({"event": "end", "name": step.name, "cached": done.cached, "seconds": done.record.seconds})
        return done

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        """On a thread of its own."""
        return Beside(lambda: self(step, **inputs)).result

    def has(self, step: Step, **inputs: Input) -> bool:
        return is_done(step, self._place, self._config, inputs)

    def under(self, config: DreamConfig) -> Plainly:
        return Plainly(self._place, config)

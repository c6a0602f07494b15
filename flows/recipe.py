"""From a caption to an object: which step follows which. The only place where the steps are wired, whoever conducts them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from dreamfields_core.config import DreamConfig
from flows.beside import Beside
from tasks.encoders import card
from tasks.step import Done, Input, Place, Step, perform
from tasks.steps import ENCODE, MESH, OPTIMIZE, RENDER, SCORE


@dataclass(frozen=True)
class Dream:
    """What was done for one caption, step by step."""

    words: Done
    field: Done
    pictures: Done
    mesh: Done
    score: Done

    @property
    def steps(self) -> tuple[Done, ...]:
        """In the order of the recipe."""
        return (self.words, self.field, self.pictures, self.mesh, self.score)


class Conductor(Protocol):
    """Who has the steps done."""

    def __call__(self, step: Step, **inputs: Input) -> Done:
        """Do a step now, on this thread, so that signals reach it."""

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        """Begin a step beside others; call what comes back for its result."""


def make_object(conduct: Conductor, caption: str, config: DreamConfig) -> Dream:
    """Encode the caption, optimise a field for it, render and mesh the field side by side, and score what came out."""
    guide, judge = card(config.guidance.name), card(config.evaluate.judge)
    words = conduct(ENCODE, caption=caption, guide=guide.digest)
    dreamt = conduct(OPTIMIZE, text_embedding=words.output("text_embedding.npy"), guide=guide.digest)
    field = dreamt.output("field.safetensors")
    rendering = conduct.start(RENDER, field=field, caption=caption, size=config.evaluate.size or judge.image_size)
    mesh = conduct(MESH, field=field, caption=caption)
    pictures = rendering()
    score = conduct(SCORE, views=pictures.output("views.npz"), mesh=mesh.output("mesh.glb"), caption=caption, judge=judge.digest)
    return Dream(words, dreamt, pictures, mesh, score)


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

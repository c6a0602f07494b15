"""A dream under way: its steps timed one by one, and what the judge says of it as it goes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import scenes
from benchmarks.timing import Times
from dreamfields_core.config import DreamConfig
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import DreamState
from dreamfields_core.rendering.images import on_white, view_renderer
from dreamfields_core.scene.cameras import poses_at
from dreamfields_core.types import Array
from tasks.encoders import load_encoder

LOOKS = 10
"""Times that the judge looks in the course of a dream."""


Look = Callable[[DreamProgram, DreamState], float]
"""What the judge says of the held-out views: the mean cosine with the caption."""


def judge_of(config: DreamConfig, caption: str) -> Look:
    """The judge that the preset names, in the preset's held-out views."""
    evaluate = config.evaluate
    judge = load_encoder(evaluate.judge)
    words = scenes.text_embedding(judge, caption)
    poses = poses_at(evaluate.azimuths, evaluate.elevation, radius=evaluate.radius, focal=evaluate.focal)
    encode = jax.jit(judge.encode_image)

    def look(program: DreamProgram, state: DreamState) -> float:
        render = program.config.render
        see = view_renderer(
            program.field, state.params, state.origin, state.occupancy, samples=render.samples, bound=config.scene.bound, skip=render.skip
        )
        size = evaluate.size or judge.image_size
        views = [on_white(see(jax.tree.map(lambda leaf, view=view: leaf[view], poses), size)) for view in range(len(evaluate.azimuths))]
        return float(jnp.mean(encode(judge.params, jnp.asarray(np.stack(views), jnp.float32)) @ words))

    return look


@dataclass
class Course:
    """How one dream went: times of its steps, shares of samples evaluated, and (step, seconds, cosine) each time the judge looked."""

    times: Times = field(default_factory=Times)
    evaluated: list[float] = field(default_factory=list)
    looks: list[tuple[int, float, float]] = field(default_factory=list)

    def row(self) -> dict[str, Any]:
        return {
            "steps": len(self.times.wall),
            "wall_s": round(sum(self.times.wall), 2),
            "processor_s": round(sum(self.times.processor), 2),
            "a step": self.times.row(),
            "evaluated_mean": round(float(np.mean(self.evaluated)), 4),
            "cosine": self.looks[-1][2],
            "looks": [(step, round(spent, 2), round(cosine, 4)) for step, spent, cosine in self.looks],
        }


class Dream:
    """A dream under way; only its steps are timed."""

    def __init__(self, program: DreamProgram, text: Array, look: Look) -> None:
        self.state, self.course = program.start(), Course()
        self._program, self._text, self._look = program, text, look
        compiled(program, text)

    @property
    def is_over(self) -> bool:
        return len(self.course.evaluated) == self._program.config.optim.steps

    def advance(self) -> None:
        """One step, and a look at the field every so often."""
        course, steps = self.course, self._program.config.optim.steps
        self.state, metrics = course.times.add(partial(self._program.step, self.state, self._text))
        course.evaluated.append(float(metrics["evaluated"]))
        if len(course.evaluated) % max(1, steps // LOOKS) == 0 or self.is_over:
            course.looks.append((len(course.evaluated), sum(course.times.processor), self._look(self._program, self.state)))


class Sample:
    """One dense step in `every`, from another dream's state, timed and thrown away."""

    def __init__(self, program: DreamProgram, text: Array, every: int) -> None:
        self._program, self._text, self._every, self._times = program, text, every, Times()
        compiled(program, text)

    def __call__(self, state: DreamState) -> None:
        if int(state.step) % self._every == 0:
            self._times.add(partial(self._program.step, jax.tree.map(jnp.copy, state), self._text))

    def row(self, steps: int) -> dict[str, Any]:
        """What so many steps would have taken."""
        mean = {clock: float(np.mean(getattr(self._times, clock))) for clock in ("wall", "processor")}
        return {"steps": 0, **{f"{clock}_s": round(steps * mean[clock], 2) for clock in mean}, "sampled": self._times.row()}


def compiled(program: DreamProgram, text: Array) -> None:
    """One step on a state that nobody needs."""
    jax.block_until_ready(program.step(program.start(), text))

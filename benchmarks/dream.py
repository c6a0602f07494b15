"""Whole dreams: the residual network with skipping, the same without, and the hybrid field; seconds, and the judge's cosine.

The dense dream costs hours on a few cores. With `--dense sampled` it is not dreamt: every so often one dense step is taken from the
skipping dream's state and thrown away, and since a dense step costs the same whatever the scene, their mean times the number
of steps is what the dense dream would have taken. The difference in cosine is then not known and left empty.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import scenes
from benchmarks.drawing import sheet
from benchmarks.timing import Times
from dreamfields_core.config import DreamConfig, ResidualMLPConfig, SkipConfig, override
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import DreamState
from dreamfields_core.judging.retrieval import mean_with_error
from dreamfields_core.presets import preset
from dreamfields_core.rendering.images import on_white, view_renderer
from dreamfields_core.scene.cameras import poses_at
from dreamfields_core.types import Array
from storage.digests import json_digest
from tasks.encoders import load_encoder

CAPTIONS = (
    "a red mushroom",
    "a blue cup",
    "a pink ice cream",
    "a green tree",
    "a yellow house",
    "a purple sphere",
    "an orange cone",
    "a white table",
)
LOOKS = 10
"""Times that the judge looks in the course of a dream."""


@dataclass(frozen=True)
class Options:
    """captions: of CAPTIONS, the first so many. steps: of the residual network. hybrid_steps: of the hybrid field, 0 for as many.
    dense: "whole" dreams without skipping too, "sampled" takes one dense step in `every`. rate: Adam's, of the residual network,
    which learns at the paper's 1e-4 in ten thousand steps. settings: of the preset `draft`, as `--set` takes them."""

    captions: int = 8
    steps: int = 1000
    hybrid_steps: int = 0
    dense: str = "whole"
    every: int = 50
    rate: float = 5e-4
    settings: tuple[str, ...] = ("seed=0",)


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


def run(options: Options) -> dict[str, Any]:
    """A row per caption and way. A caption's row is kept in the cache as soon as it is there: run again, the rest is made."""
    if options.dense not in ("whole", "sampled"):
        raise SystemExit(f'expected --dense whole or sampled, got "{options.dense}"')
    configs = ways(options)
    guide = load_encoder(configs["hybrid"].guidance.name)
    programs = {name: DreamProgram(config, guide) for name, config in configs.items()}
    said = [config.model_dump(mode="json") for config in configs.values()]
    rows = []
    for caption in CAPTIONS[: options.captions]:
        name = json_digest(["dream", caption, said, guide.digest, options.dense, options.every])
        rows.append(
            json.loads(scenes.kept(name, lambda caption=caption: json.dumps(compared(caption, programs, options)).encode(), ending="json"))
        )
    return {"headline": headline(rows), "clock": "processor seconds over all cores", "options": options.__dict__, "rows": rows}


def compared(caption: str, programs: dict[str, DreamProgram], options: Options) -> dict[str, Any]:
    """One caption, dreamed every way."""
    config = programs["hybrid"].config
    text, look = scenes.text_embedding(programs["hybrid"].encoder, caption), judge_of(config, caption)
    dense = Times()
    if options.dense == "sampled":
        compiled(programs["dense"], text)
        beside = partial(_sample, programs["dense"], text, dense, options.every)
        courses = {"skipping": dream(programs["skipping"], text, look, beside=beside)}
    else:
        courses = {name: dream(programs[name], text, look) for name in ("skipping", "dense")}
    courses["hybrid"] = dream(programs["hybrid"], text, look)
    row: dict[str, Any] = {"caption": caption, **{name: course.row() for name, course in courses.items()}}
    if dense.wall:
        mean = {clock: float(np.mean(getattr(dense, clock))) for clock in ("wall", "processor")}
        row["dense"] = {"steps": 0, **{f"{clock}_s": round(options.steps * mean[clock], 2) for clock in mean}, "sampled": dense.row()}
    return row


def ways(options: Options) -> dict[str, DreamConfig]:
    """The draft preset's resolution for all; the residual network with and without skipping, and the preset as it is."""
    draft = override(preset("draft"), options.settings)
    hybrid = draft.model_copy(update={"optim": draft.optim.model_copy(update={"steps": options.hybrid_steps or options.steps})})
    optim = draft.optim.model_copy(update={"steps": options.steps, "rate_start": options.rate, "rate": options.rate, "rate_end": None})
    # The savings of the presets of the paper's network; when they begin and how often they look, of the draft.
    savings = preset("low").render.skip.model_dump() | draft.render.skip.model_dump(include={"warmup_steps", "refresh_every"})
    skips = {"skipping": SkipConfig.model_validate(savings), "dense": SkipConfig(enabled=False)}
    skipping, dense = (
        draft.model_copy(
            update={"field": ResidualMLPConfig(), "optim": optim, "render": draft.render.model_copy(update={"skip": skips[name]})}
        )
        for name in ("skipping", "dense")
    )
    return {"skipping": skipping, "dense": dense, "hybrid": hybrid}


def headline(rows: list[dict[str, Any]]) -> dict[str, float | None]:
    """Ratios of total processor seconds; the judge's mean difference, ours minus dense, and its standard error over the captions."""
    spent = {name: sum(row[name]["processor_s"] for row in rows) for name in ("skipping", "dense", "hybrid")}
    pairs = [row["skipping"]["cosine"] - row["dense"]["cosine"] for row in rows if "cosine" in row["dense"]]
    mean, error = mean_with_error(pairs) if pairs else (None, None)
    return {
        "speedup": round(spent["dense"] / spent["skipping"], 3),
        "speedup_hybrid": round(spent["skipping"] / spent["hybrid"], 3),
        "cosine_difference": mean,
        "cosine_standard_error": error if error is not None and np.isfinite(error) else None,
        "captions": len(rows),
    }


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


def dream(program: DreamProgram, text: Array, look: Look, *, beside: Callable[[DreamState], None] | None = None) -> Course:
    """A dream from start to end; only its steps are timed. beside: done before each step, with its state."""
    course, state, steps = Course(), program.start(), program.config.optim.steps
    compiled(program, text)
    for number in range(steps):
        if beside is not None:
            beside(state)
        state, metrics = course.times.add(partial(program.step, state, text))
        course.evaluated.append(float(metrics["evaluated"]))
        if (number + 1) % max(1, steps // LOOKS) == 0 or number + 1 == steps:
            course.looks.append((number + 1, sum(course.times.processor), look(program, state)))
    return course


def compiled(program: DreamProgram, text: Array) -> None:
    """One step on a state that nobody needs."""
    jax.block_until_ready(program.step(program.start(), text))


def _sample(program: DreamProgram, text: Array, times: Times, every: int, state: DreamState) -> None:
    """One dense step in `every`, timed and thrown away."""
    if int(state.step) % every == 0:
        times.add(partial(program.step, jax.tree.map(jnp.copy, state), text))


def plot(result: dict[str, Any], path: Path) -> None:
    """The judge's cosine against the seconds spent."""
    with sheet(path) as panels:
        for name, color in (("skipping", "tab:red"), ("dense", "tab:gray"), ("hybrid", "tab:blue")):
            courses = [row[name]["looks"] for row in result["rows"] if "looks" in row[name]]
            for number, looks in enumerate(courses):
                panels[0].plot(
                    [spent for _, spent, _ in looks],
                    [cosine for *_, cosine in looks],
                    ".-",
                    color=color,
                    alpha=0.7,
                    label=name if not number else None,
                )
        panels[0].set(xscale="log", xlabel="processor seconds", ylabel="judge's cosine with the caption", title="whole dreams")

"""One optimisation step of the residual network: ours against the dense path, on a settled scene and at the very first steps.

Every way takes the same step of the same state: pose, jitter, backgrounds and crops follow from the step's number. The gradient
is read from Adam's first moment, which after one step from nothing is a tenth of it. The error of a way is the angle of its
gradient to the dense path's, which evaluates every sample of every ray.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import scenes
from benchmarks.drawing import sheet
from benchmarks.record import spread
from benchmarks.timing import Times, matrix_rate, ratio
from dreamfields_core.config import DreamConfig, SkipConfig, override
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import DreamState
from dreamfields_core.presets import preset
from dreamfields_core.rendering.occupancy import Occupancy
from dreamfields_core.types import Array, Params
from tasks.encoders import load_encoder

WAYS = {
    "ours": {},
    "all slopes": {"learn": 1.0},
    "half as many slopes": {"learn": 0.05},
    "coarse memory": {"resolution": 32},
    "no termination": {"terminate": 0.0},
    "more exploration": {"explore": 0.1},
    "coarser threshold": {"threshold": 1e-2},
}
"""Changes of SkipConfig, beside the dense path."""


@dataclass(frozen=True)
class Options:
    """settings: of the preset `low`, as `--set` takes them. poses: steps on the settled scene. first: steps from the start.
    ways: of WAYS, beside the dense path. growth: sides and samples that our step alone is also timed at, as "44x192".
    fit_steps, dream_steps: of making the settled scene, from a dream with `draft`."""

    settings: tuple[str, ...] = ("seed=0",)
    poses: int = 8
    first: int = 3
    ways: tuple[str, ...] = tuple(WAYS)
    growth: tuple[str, ...] = ("44x192", "88x96", "88x192", "88x384", "176x192")
    draft: tuple[str, ...] = ("seed=0",)
    fit_steps: int = 600
    dream_steps: int = 16


def run(options: Options) -> dict[str, Any]:
    """Steps on the settled scene, then the first ones."""
    config = override(preset("low"), options.settings)
    scene = scenes.settled(
        config.field, source=override(preset("draft"), options.draft), fit_steps=options.fit_steps, dream_steps=options.dream_steps
    )
    encoder = load_encoder(config.guidance.name, towers=("image",))
    text = scenes.text_embedding(load_encoder(config.guidance.name, towers=("text",)), scenes.CAPTION)
    skips = {"dense": {"enabled": False}} | {name: WAYS[name] for name in options.ways}
    programs = {name: DreamProgram(_with(config, changes), encoder) for name, changes in skips.items()}

    known: dict[int, Occupancy] = {}

    def settled(program: DreamProgram) -> DreamState:
        state = program.start().replace(params=scene.params, origin=scene.origin)
        cells = program.config.render.skip.resolution
        if cells not in known:
            known[cells] = scenes.remembered(program, state)
        return state.replace(occupancy=known[cells])

    late = 10 * config.loss.anneal_steps
    formed = compare({name: Stepper(program, settled, text, late) for name, program in programs.items()}, rounds=options.poses)
    few = {name: Stepper(programs[name], DreamProgram.start, text, 0) for name in ("dense", "ours")}
    fresh = compare(few, rounds=options.first)
    grown = {}
    for label in options.growth:
        size, samples = (int(number) for number in label.split("x"))
        render = config.render.model_copy(update={"size": size, "crop": max(1, size * 10 // 11), "samples": samples})
        program = DreamProgram(config.model_copy(update={"render": render}), encoder)
        grown[label] = compare({label: Stepper(program, settled, text, late)}, rounds=options.first, against=label)[label]
        grown[label]["samples"] = size * size * config.camera.views * samples
    points = config.render.size**2 * config.camera.views * config.render.samples
    rate = matrix_rate()
    # A sample outside the cube has no slope, and the gradient passes it over. Our very first steps evaluate what lies inside.
    inside = fresh["ours"]["evaluated"]["median"]
    for name, row in (*formed.items(), *fresh.items()):
        work = gflop(scene.params, learn=inside if name == "dense" else programs[name].config.render.skip.learn)
        row["gflop_per_s"] = work * points * row["evaluated"]["median"] / row["processor_s"]["median"]
    ours, first = formed["ours"], fresh["ours"]
    return {
        "headline": {
            "speedup_settled": ours["speedup"]["processor"]["median"],
            "gradient_cosine": ours["cosine"]["mean"],
            "speedup_first_steps": first["speedup"]["processor"]["median"],
            "speedup_settled_wall": ours["speedup"]["wall"]["median"],
            "speedup_first_steps_wall": first["speedup"]["wall"]["median"],
            "share_of_matrix_rate": round(formed["dense"]["gflop_per_s"] / rate["processor"]["median"], 3),
        },
        "clock": "processor seconds over all cores unless a name says wall",
        "options": options.__dict__,
        "samples_a_step": points,
        "share_inside": inside,
        "parameters": int(sum(leaf.size for leaf in jax.tree.leaves(scene.params))),
        "gflop_a_sample": gflop(scene.params),
        "matrix_gflop_per_s": rate,
        "settled": formed,
        "first_steps": fresh,
        "growth": grown,
    }


def gflop(params: Params, *, learn: float = 1.0) -> float:
    """Of the matrix products of one sample: forward; and for the share that is learned from, forward again and backward, which counts
    twice."""
    return (1 + 3 * learn) * 2e-9 * sum(leaf.size for leaf in jax.tree.leaves(params) if leaf.ndim == 2)


@dataclass(frozen=True)
class Stepper:
    """program; begin: gives the state to step from; text [dim]; number: of the first step, which decides its randomness."""

    program: DreamProgram
    begin: Callable[[DreamProgram], DreamState]
    text: Array
    number: int

    def state(self, turn: int) -> DreamState:
        """Copies of its own: a step consumes its state."""
        copied = jax.tree.map(jnp.copy, self.begin(self.program)).replace(step=jnp.int32(self.number + turn))
        return jax.block_until_ready(copied)

    def step(self, state: DreamState) -> tuple[Params, Array]:
        """Ten times the gradient's direction, and the share of samples evaluated."""
        after, metrics = self.program.step(state, self.text)
        return after.opt_state.mu, metrics["evaluated"]


def compare(steppers: dict[str, Stepper], *, rounds: int, against: str = "dense") -> dict[str, Any]:
    """Every way in turn; a row each with its times, its share of samples evaluated, its gradient's cosine with that of `against`."""
    for stepper in steppers.values():
        jax.block_until_ready(stepper.step(stepper.state(0)))
    taken = {name: Times() for name in steppers}
    cosines: dict[str, list[float]] = {name: [] for name in steppers}
    shares: dict[str, list[float]] = {name: [] for name in steppers}
    for turn in range(rounds):
        gradients = {}
        for name in list(steppers)[:: -1 if turn % 2 else 1]:
            state = steppers[name].state(turn)
            gradients[name], share = taken[name].add(partial(steppers[name].step, state))
            shares[name].append(float(share))
        for name, gradient in gradients.items():
            cosines[name].append(cosine(gradient, gradients[against]))
    return {
        name: {
            **taken[name].row(),
            "speedup": ratio(taken[against], taken[name]),
            "evaluated": spread(shares[name]),
            "cosine": {"mean": round(float(np.mean(cosines[name])), 6), **spread(cosines[name])},
        }
        for name in steppers
    }


def cosine(one: Params, other: Params) -> float:
    """Of two gradients as one long vector each, in float64."""
    a, b = (np.concatenate([np.asarray(leaf, np.float64).ravel() for leaf in jax.tree.leaves(tree)]) for tree in (one, other))
    return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-300))


def _with(config: DreamConfig, changes: dict[str, Any]) -> DreamConfig:
    skip = SkipConfig.model_validate(config.render.skip.model_dump() | changes)
    return config.model_copy(update={"render": config.render.model_copy(update={"skip": skip})})


def plot(result: dict[str, Any], path: Path) -> None:
    """Seconds of a step against the error of its gradient, 1 - cosine."""
    with sheet(path, panels=2) as panels:
        for panel, (stage, title) in zip(panels, (("settled", "settled scene"), ("first_steps", "the very first steps")), strict=True):
            for name, row in result[stage].items():
                error = max(1.0 - row["cosine"]["mean"], 1e-8)
                time = row["processor_s"]
                panel.errorbar(
                    time["median"], error, xerr=[[time["median"] - time["low"]], [time["high"] - time["median"]]], fmt="o", label=name
                )
            panel.set(
                title=title, xlabel="processor seconds a step", ylabel="1 - cosine with the dense gradient", xscale="log", yscale="log"
            )

"""What a sample of the paper's network costs: its encoding's waves, its evaluation and its gradient, by how many share a chunk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.drawing import sheet
from benchmarks.scenes import random_gaussians
from benchmarks.step import gflop
from benchmarks.timing import Way, matrix_rate, ratio, take_turns
from dreamfields_core.config import ResidualMLPConfig, SceneConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.residual_mlp import residual_mlp
from dreamfields_core.fields.waves import sine_cosine
from dreamfields_core.rendering.packing import chunk_size, evaluate_packed
from dreamfields_core.types import Array, Gaussians, Params


@dataclass(frozen=True)
class Options:
    """samples: evaluated. learned: of them, that have a slope. chunks: samples each. angles: how many, up to `largest` radians.
    rounds: of timing."""

    samples: int = 32768
    learned: int = 3500
    chunks: tuple[int, ...] = (256, 512, 1024, 2048, 4096, 16384)
    angles: int = 131072
    largest: float = 500.0
    rounds: int = 9


def run(options: Options) -> dict[str, Any]:
    """The headline is that of the chunk that this device takes where nothing is said."""
    field = residual_mlp(ResidualMLPConfig())
    params = jax.jit(field.init)(jax.random.key(0))
    found, chunks, rate = waves(options), evaluations(field, params, options), matrix_rate()
    usual = chunks.get(str(chunk_size(None)), next(iter(chunks.values())))
    reached = gflop(params, learn=0.0) / (1e-6 * usual["forward_us"])
    return {
        "headline": {
            "waves_speedup": found["speedup"]["processor"]["median"],
            "waves_error": found["error"],
            "microseconds_a_sample": usual["forward_us"],
            "share_of_matrix_rate": round(reached / rate["processor"]["median"], 3),
        },
        "clock": "processor seconds over all cores",
        "options": options.__dict__,
        "matrix_gflop_per_s": rate,
        "waves": found,
        "chunks": chunks,
    }


def waves(options: Options) -> dict[str, Any]:
    """Sine and cosine of the same angles, XLA's own and ours; nanoseconds an angle, and our largest distance from float64's."""
    drawn = np.random.default_rng(0).uniform(-options.largest, options.largest, options.angles).astype(np.float32)
    angles, exact = jnp.asarray(drawn), drawn.astype(np.float64)
    ways = {"xla": jax.jit(lambda angle: (jnp.sin(angle), jnp.cos(angle))), "ours": jax.jit(sine_cosine)}
    taken = take_turns({name: partial(_call, way, angles) for name, way in ways.items()}, rounds=options.rounds)
    sine, cosine = ways["ours"](angles)
    return {
        **{f"{name}_ns": _each(taken[name].processor, options.angles, 1e9) for name in ways},
        "speedup": ratio(taken["xla"], taken["ours"]),
        "error": float(max(np.abs(sine - np.sin(exact)).max(), np.abs(cosine - np.cos(exact)).max())),
    }


def evaluations(field: Field, params: Params, options: Options) -> dict[str, dict[str, float]]:
    """By chunk: microseconds a sample evaluated, and a sample learned from where `learned` are."""
    gaussians = random_gaussians(jax.random.key(1), jnp.zeros(3), bound=SceneConfig().bound, count=options.samples)
    mask = jnp.ones(options.samples, bool)
    slopes = jnp.zeros(options.samples).at[jax.random.permutation(jax.random.key(2), options.samples)[: options.learned]].set(1.0)

    def at(samples: Gaussians, index: Array) -> Gaussians:
        return jax.tree.map(lambda leaf: leaf[index], samples)

    def evaluate(params: Params, *, chunk: int) -> Array:
        return evaluate_packed(field.apply, at, chunk, field.prepare(params), gaussians, mask)[0]

    def slope(params: Params, *, chunk: int) -> Params:
        # Nothing reads the values themselves, so their evaluation is left out of this program.
        return jax.grad(lambda params: jnp.sum(slopes * evaluate(params, chunk=chunk)))(params)

    ways: dict[str, Way] = {}
    for chunk in options.chunks:
        ways[f"forward {chunk}"] = partial(_call, jax.jit(partial(evaluate, chunk=chunk)), params)
        ways[f"learn {chunk}"] = partial(_call, jax.jit(partial(slope, chunk=chunk)), params)
    taken = take_turns(ways, rounds=options.rounds)
    return {
        str(chunk): {
            "forward_us": _each(taken[f"forward {chunk}"].processor, options.samples, 1e6),
            "learn_us": _each(taken[f"learn {chunk}"].processor, options.learned, 1e6),
        }
        for chunk in options.chunks
    }


def _call(way: Any, argument: Any, turn: int) -> Any:
    return way(argument)


def _each(seconds: list[float], count: int, unit: float) -> float:
    return round(float(np.median(seconds)) / count * unit, 3)


def plot(result: dict[str, Any], path: Path) -> None:
    """Microseconds a sample against the chunk."""
    with sheet(path) as panels:
        sizes = [int(chunk) for chunk in result["chunks"]]
        for name, label in (("forward_us", "evaluated"), ("learn_us", "learned from")):
            panels[0].plot(sizes, [row[name] for row in result["chunks"].values()], "o-", label=label)
        panels[0].set(
            xscale="log", yscale="log", xlabel="samples a chunk", ylabel="processor microseconds a sample", title="residual network"
        )

"""Iso-surfaces: coarse to fine against asking the whole lattice; evaluations, seconds and error, on a ball and on a dreamed object.

The error on the ball is the vertices' distance from it; on the dreamed object, how far the field's value at a vertex is from the
level, over the field's slope there, which is a distance too. The dense path is the same extraction with every corner asked before.
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
from benchmarks.timing import ratio, take_turns
from dreamfields_core.config import override
from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.meshing.isosurface import coarse_values, extract
from dreamfields_core.meshing.lattice import Field, Lattice, Packed, Samples
from dreamfields_core.presets import preset
from dreamfields_core.types import Mesh

RADIUS = 0.6
DENSITY = 10.0
"""Level at which the dreamed object is cut, 1 / world unit."""


@dataclass(frozen=True)
class Options:
    """resolutions: cells a side. rounds: of timing. batch: points asked at once. draft: settings of the dream."""

    resolutions: tuple[int, ...] = (64, 128, 256)
    rounds: int = 3
    batch: int = 32768
    draft: tuple[str, ...] = ("seed=0",)


def run(options: Options) -> dict[str, Any]:
    """A row per object and resolution; the headline is the dreamed object at the finest."""
    rows = []
    for name, (field, level, distance) in _objects(options).items():
        for resolution in options.resolutions:
            rows.append({"object": name, "resolution": resolution, **measure(field, level, distance, resolution, options)})
    last = rows[-1]
    return {
        "headline": {
            "evaluations_fraction": round(last["evaluations"] / last["evaluations_dense"], 5),
            "speedup": last["speedup"]["processor"]["median"],
            "error_in_cells": last["error_in_cells"],
        },
        "options": options.__dict__,
        "rows": rows,
    }


Distance = Callable[[np.ndarray], np.ndarray]
"""Vertices [V, 3] -> distance of each from the true surface, world units."""


def measure(field: Field, level: float, distance: Distance, resolution: int, options: Options) -> dict[str, Any]:
    """One object at one resolution, both ways in turn."""
    asked: dict[str, int] = {}
    meshes: dict[str, Mesh] = {}

    def make(turn: int, *, way: str) -> None:
        ask = Packed(field, batch=options.batch)
        samples = Samples(Lattice((0.0, 0.0, 0.0), 1.0, resolution), ask)
        if way == "dense":
            samples.at(np.stack(np.meshgrid(*(np.arange(resolution + 1),) * 3, indexing="ij"), axis=-1))
        meshes[way] = extract(samples, coarse_values(samples), level)
        asked[way] = ask.asked

    taken = take_turns({way: partial(make, way=way) for way in ("ours", "dense")}, rounds=options.rounds)
    error = float(np.sqrt(np.mean(distance(meshes["ours"].vertices) ** 2)))
    return {
        "faces": len(meshes["ours"].faces),
        "same_mesh": len(meshes["ours"].faces) == len(meshes["dense"].faces),
        "evaluations": asked["ours"],
        "evaluations_dense": asked["dense"],
        "error": error,
        "error_in_cells": round(error * resolution / 2.0, 5),
        "ours": taken["ours"].row(),
        "dense": taken["dense"].row(),
        "speedup": ratio(taken["dense"], taken["ours"]),
    }


def _objects(options: Options) -> dict[str, tuple[Field, float, Distance]]:
    dream = scenes.dreamed(override(preset("draft"), options.draft))
    prepared = jax.jit(dream.field.prepare)(dream.params)
    ask = jax.jit(lambda points: dream.field.apply(prepared, points_as_gaussians(points))[0])
    slopes = jax.jit(jax.vmap(jax.value_and_grad(lambda point: dream.field.apply(prepared, points_as_gaussians(point[None, :]))[0][0])))
    level = dream.field.raw(DENSITY)

    def away(vertices: np.ndarray) -> np.ndarray:
        value, slope = slopes(jnp.asarray(vertices))
        return np.asarray(jnp.abs(value - level) / jnp.maximum(jnp.linalg.norm(slope, axis=-1), 1e-6))

    return {
        "ball": (
            lambda points: 20.0 * (RADIUS - np.linalg.norm(points, axis=-1)),
            0.0,
            lambda vertices: np.abs(np.linalg.norm(vertices, axis=-1) - RADIUS),
        ),
        "dreamed": (lambda points: np.asarray(ask(jnp.asarray(points))), level, away),
    }


def plot(result: dict[str, Any], path: Path) -> None:
    """Error against processor seconds."""
    names = sorted({row["object"] for row in result["rows"]})
    with sheet(path, panels=len(names)) as panels:
        for panel, name in zip(panels, names, strict=True):
            rows = [row for row in result["rows"] if row["object"] == name]
            for way, color in (("dense", "tab:gray"), ("ours", "tab:red")):
                times = [row[way]["processor_s"]["median"] for row in rows]
                panel.loglog(times, [row["error"] for row in rows], "o-", color=color, label=way)
            panel.set(title=name, xlabel="processor seconds", ylabel="rms distance of vertices from the surface")

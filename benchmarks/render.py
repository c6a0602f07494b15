"""Held-out pictures: error against field evaluations and against seconds, for even steps and for ours, and the order of convergence.

Truth is a float64 quadrature of 4 096 samples (closed form for the sharp ball) with the footprint of a 512-sample step. All ways see that
same footprint, so only the quadrature is compared. Errors are taken on pixels drawn at random from the picture: the mean
squared error over them is an unbiased estimate of the picture's.
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
from benchmarks.analytic import COLORS, ball, chords
from benchmarks.drawing import sheet
from benchmarks.timing import take_turns
from benchmarks.truth import quadrature
from dreamfields_core.config import SkipConfig, override
from dreamfields_core.fields.contract import Field
from dreamfields_core.presets import preset
from dreamfields_core.rendering.occupancy import Occupancy, refresh, unknown_occupancy
from dreamfields_core.rendering.refining import render_refined
from dreamfields_core.rendering.sampling import step_length
from dreamfields_core.scene.cameras import camera_rays, poses_at
from dreamfields_core.types import Array, Params, Rays
from tasks.finished_field import FinishedField

RADIUS, DENSITY = 0.6, 40.0
DREAMS = ("dreamed", "settled")
FLAT = 0.5
"""Order of convergence below which the error has reached a floor: what the skipping leaves out, however fine the steps."""
SCENES = ("smooth ball", "sharp ball", *DREAMS)
"""Two with answers in closed form or nearly so, a dream of the draft preset, and the paper's residual network."""


@dataclass(frozen=True)
class Options:
    """scenes: of SCENES. size: side of the picture. pixels: of it that are rendered. truth: samples of the float64 quadrature.
    samples: of the dense path along the cube's diagonal. counts: samples that error is drawn against. finer: K of the two-pass way.
    rounds: of timing. settled_pixels: of the residual network, which is asked in float64 as often as the others and costs far more.
    draft: settings of the dream, as `--set` takes them. fit_steps, dream_steps: of making the settled network."""

    scenes: tuple[str, ...] = SCENES
    size: int = 400
    pixels: int = 8192
    samples: int = 512
    truth: int = 4096
    counts: tuple[int, ...] = (32, 64, 128, 256, 512, 1024)
    finer: int = 8
    rounds: int = 3
    settled_pixels: int = 1024
    fit_steps: int = 600
    dream_steps: int = 16
    draft: tuple[str, ...] = ("seed=0",)


Truth = Callable[[Rays], tuple[np.ndarray, np.ndarray]]
"""Rays [R] -> colour [R, 3], premultiplied, and transmittance [R], float64."""


@dataclass(frozen=True)
class Scene:
    """What is rendered, what is true of it, and in how many pixels the two are compared."""

    field: Field
    params: Params
    origin: Array
    occupancy: Occupancy
    truth: Truth
    pixels: int


def run(options: Options) -> dict[str, Any]:
    """A row per scene, way and count; the headline is the worse dream's."""
    rows: list[dict[str, Any]] = []
    summaries = {}
    for name in options.scenes:
        measured = measure(scene_of(name, options), options)
        rows += [{"scene": name, **row} for row in measured]
        summaries[name] = summary(measured, samples=options.samples)
    worst = min((summaries[name] for name in DREAMS if name in summaries), key=lambda one: one["ours_psnr_db"], default=summaries[name])
    return {
        "headline": {"psnr_db": worst["ours_psnr_db"], "evaluations_fraction": worst["ours_evaluations_fraction"]},
        "options": {**options.__dict__},
        "scenes": summaries,
        "rows": rows,
    }


def measure(scene: Scene, options: Options) -> list[dict[str, Any]]:
    """Every way at every count on one scene: error, evaluations a ray, seconds taken in turn."""
    rays = random_rays(scene.origin, size=options.size, pixels=scene.pixels)
    color, transmittance = scene.truth(rays)
    target = color + transmittance[:, None]
    ways = {
        (way, count): _renderer(scene, rays, skip, samples=count, footprint=step_length(bound=1.0, count=options.samples))
        for count in options.counts
        for way, skip in _ways(options).items()
    }
    taken = take_turns({f"{way} {count}": lambda turn, view=view: view() for (way, count), view in ways.items()}, rounds=options.rounds)
    rows = []
    for (way, count), view in ways.items():
        picture, evaluated = jax.device_get(view())
        error = float(np.mean((np.asarray(picture, np.float64) - target) ** 2))
        rows.append(
            {
                "way": way,
                "samples": count,
                "rms": error**0.5,
                "psnr_db": round(-10.0 * float(np.log10(max(error, 1e-20))), 2),
                "evaluations_a_ray": round(float(evaluated) / scene.pixels, 3),
                **taken[f"{way} {count}"].row(),
            }
        )
    return rows


def summary(rows: list[dict[str, Any]], *, samples: int) -> dict[str, Any]:
    """Ours at its best within 5 % of the dense evaluations, the dense path beside it, and both orders of convergence."""
    dense = next(row for row in rows if row["way"] == "dense" and row["samples"] == samples)
    ours = [row for row in rows if row["way"] == "skipping"]
    within = [row for row in ours if row["evaluations_a_ray"] <= 0.05 * samples] or [min(ours, key=lambda row: row["evaluations_a_ray"])]
    best = max(within, key=lambda row: row["psnr_db"])
    return {
        "dense_psnr_db": dense["psnr_db"],
        "ours_psnr_db": best["psnr_db"],
        "ours_samples": best["samples"],
        "ours_evaluations_fraction": round(best["evaluations_a_ray"] / samples, 5),
        "seconds_ratio": round(dense["processor_s"]["median"] / max(best["processor_s"]["median"], 1e-9), 2),
        "order": {way: order([row for row in rows if row["way"] == way]) for way in sorted({row["way"] for row in rows})},
    }


def order(rows: list[dict[str, Any]]) -> float:
    """p in error ~ samples^-p, a straight line through the logarithms."""
    return round(-float(np.polyfit(np.log([row["samples"] for row in rows]), np.log([row["rms"] + 1e-12 for row in rows]), 1)[0]), 2)


def random_rays(origin: Array, *, size: int, pixels: int) -> Rays:
    """Rays [pixels] of the held-out view (paper section 5.1), drawn without repeats."""
    look = preset("low").evaluate
    rays = camera_rays(poses_at(look.azimuths[:1], look.elevation, radius=look.radius, focal=look.focal), origin, size=size)
    chosen = np.random.default_rng(0).permutation(size * size)[:pixels]
    return jax.tree.map(lambda leaf: leaf.reshape(-1, leaf.shape[-1])[chosen], rays)


def _ways(options: Options) -> dict[str, SkipConfig]:
    return {
        "dense": SkipConfig(enabled=False),
        "skipping": SkipConfig(refine=1),
        "refined": SkipConfig(refine=options.finer),
    }


def _renderer(scene: Scene, rays: Rays, skip: SkipConfig, *, samples: int, footprint: float) -> Callable[[], tuple[Array, Array]]:
    """A call that gives the picture on white [R, 3] and how many samples the field was asked for."""
    prepared = jax.jit(scene.field.prepare)(scene.params)

    @jax.jit
    def view(prepared: Params, rays: Rays, occupancy: Occupancy) -> tuple[Array, Array]:
        seen, evaluated = render_refined(
            scene.field, prepared, rays, scene.origin, occupancy, samples=samples, bound=1.0, skip=skip, footprint=footprint
        )
        return seen.color + seen.transmittance[:, None], evaluated

    return lambda: view(prepared, rays, scene.occupancy)


def scene_of(name: str, options: Options) -> Scene:
    """One of SCENES, made if need be."""
    makers: dict[str, Callable[[Options], Scene]] = {
        "smooth ball": partial(_ball, softness=0.05),
        "sharp ball": partial(_ball, softness=0.0),
        "dreamed": _dreamed,
        "settled": _settled,
    }
    if name not in makers:
        raise SystemExit(f'expected --scenes among {", ".join(SCENES)}, got "{name}"')
    return makers[name](options)


def _dreamed(options: Options) -> Scene:
    return _with_truth(scenes.dreamed(override(preset("draft"), options.draft)), options, options.pixels)


def _settled(options: Options) -> Scene:
    source = override(preset("draft"), options.draft)
    made = scenes.settled(source=source, fit_steps=options.fit_steps, dream_steps=options.dream_steps)
    return _with_truth(made, options, options.settled_pixels)


def _with_truth(made: FinishedField, options: Options, pixels: int) -> Scene:
    truth = _quadrature(made.field, made.params, np.asarray(made.origin), options)
    return Scene(made.field, made.params, made.origin, made.occupancy, truth, pixels)


def _ball(options: Options, *, softness: float) -> Scene:
    field, params, origin = ball(radius=RADIUS, softness=softness), {"density": jnp.float32(DENSITY)}, jnp.zeros(3)
    ask = jax.jit(partial(refresh, field=field, bound=1.0, decay=0.9))
    occupancy = unknown_occupancy(SkipConfig().resolution)
    for number in range(16):
        occupancy = ask(jax.random.key(number), occupancy, prepared=params, origin=origin)
    truth = _quadrature(field, params, np.zeros(3), options) if softness else sharp_truth
    return Scene(field, params, origin, occupancy, truth, options.pixels)


def _quadrature(field: Field, params: Params, origin: np.ndarray, options: Options) -> Truth:
    footprint = step_length(bound=1.0, count=options.samples)
    return lambda rays: quadrature(field, params, rays, origin, bound=1.0, samples=options.truth, footprint=footprint)


def sharp_truth(rays: Rays) -> tuple[np.ndarray, np.ndarray]:
    """The sharp ball: transmittance in closed form; its colour is linear along the ray, so its integral is closed too."""
    origins, directions = np.asarray(rays.origins, np.float64), np.asarray(rays.directions, np.float64)
    length = chords(origins, directions, radius=RADIUS)
    middle = -np.sum(origins * directions, axis=-1)
    first, last = (origins + (middle + side * length / 2)[:, None] * directions for side in (-1.0, 1.0))
    depth = DENSITY * length
    opacity = -np.expm1(-depth)
    # Mean place of absorption, as a share of the chord: (1 - (1 + x) exp(-x)) / (x (1 - exp(-x))) with x the optical depth.
    share = np.where(depth > 0, (opacity - depth * np.exp(-depth)) / np.maximum(depth * opacity, 1e-300), 0.0)
    height = 0.5 + 0.5 * (first[:, 2] + share * (last - first)[:, 2]) / RADIUS
    top, bottom = (np.asarray(color)[None, :] for color in COLORS)
    return opacity[:, None] * (height[:, None] * top + (1.0 - height[:, None]) * bottom), np.exp(-depth)


def plot(result: dict[str, Any], path: Path) -> None:
    """Error against evaluations above, against processor seconds below; a column a scene. Dotted: 45 dB, and 5 % of the dense path."""
    names = list(result["scenes"])
    with sheet(path, panels=len(names), rows=2) as panels:
        for upper, lower, name in zip(panels, panels[len(names) :], names, strict=False):
            for way, color in (("dense", "tab:gray"), ("skipping", "tab:blue"), ("refined", "tab:red")):
                rows = [row for row in result["rows"] if row["scene"] == name and row["way"] == way]
                power, floor = result["scenes"][name]["order"][way], max(row["psnr_db"] for row in rows)
                label = f"{way} (order {power})" if power > FLAT else f"{way} (floor {floor:.0f} dB)"
                errors = [row["rms"] for row in rows]
                upper.loglog([row["evaluations_a_ray"] for row in rows], errors, "o-", color=color, ms=4, label=label)
                lower.loglog([row["processor_s"]["median"] for row in rows], errors, "o-", color=color, ms=4, label=way)
            upper.axvline(0.05 * result["options"]["samples"], color="black", lw=0.6, ls=":")
            upper.set(title=name, xlabel="field evaluations a ray", ylabel="rms error of a pixel")
            lower.set(xlabel="processor seconds", ylabel="rms error of a pixel")
            for panel in (upper, lower):
                panel.axhline(10 ** (-45 / 20), color="black", lw=0.6, ls=":")

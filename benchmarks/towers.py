"""The image tower's benchmark (`benchmarks/encoder.py`: ours against PyTorch, in turn) as one of `dreamfields bench`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import encoder
from benchmarks.drawing import sheet


@dataclass(frozen=True)
class Options:
    """patches: patch sizes of the models. batch: pictures in a call. rounds: of timing."""

    patches: tuple[int, ...] = (32, 16)
    batch: int = 8
    rounds: int = 7


def run(options: Options) -> dict[str, Any]:
    """A row per model; the headline has of each how many times PyTorch's time and peak memory are ours."""
    for library in ("torch", "transformers"):
        if find_spec(library) is None:
            raise SystemExit(f"expected {library} to compare with, found none: install the extra `parity` (make test-parity does)")
    rows = [encoder.compare(patch, batch=options.batch, rounds=options.rounds) for patch in options.patches]
    headline = {"gradient_difference": max(row["gradient_difference"] for row in rows)}
    for patch, row in zip(options.patches, rows, strict=True):
        headline[f"time_ratio_b{patch}"] = row["torch_over_jax"]["median"]
        headline[f"memory_ratio_b{patch}"] = round(row["torch"]["peak_mb"] / row["jax"]["peak_mb"], 3)
    return {"headline": headline, "options": options.__dict__, "rows": rows}


def plot(result: dict[str, Any], path: Path) -> None:
    """Seconds of a call with their quartiles, and peak memory, side by side."""
    names, places = [row["model"] for row in result["rows"]], np.arange(len(result["rows"]))
    with sheet(path, panels=2) as (seconds, memory):
        for shift, kind, label in ((-0.2, "jax", "ours"), (0.2, "torch", "PyTorch")):
            times = [row[kind]["wall_s"] for row in result["rows"]]
            middle = [time["median"] for time in times]
            spread = [[time["median"] - time["low"] for time in times], [time["high"] - time["median"] for time in times]]
            seconds.bar(places + shift, middle, 0.38, yerr=spread, capsize=4, label=label)
            memory.bar(places + shift, [row[kind]["peak_mb"] for row in result["rows"]], 0.38, label=label)
        seconds.set(ylabel="seconds, median and quartiles", title=f"image and its gradient, batch {result['options']['batch']}")
        memory.set(ylabel="MB", title="peak memory of the process")
        for panel in (seconds, memory):
            panel.set_xticks(places, names)

"""The image tower's benchmark (`benchmarks/encoder.py`: ours against PyTorch, in turn) as one of `dreamfields bench`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from benchmarks import encoder
from benchmarks.drawing import sheet


@dataclass(frozen=True)
class Options:
    """patches: patch sizes of the models. batch: pictures in a call. rounds: of timing."""

    patches: tuple[int, ...] = (32, 16)
    batch: int = 8
    rounds: int = 7


def run(options: Options) -> dict[str, Any]:
    """A row per model; the headline is the last one's."""
    for library in ("torch", "transformers"):
        if find_spec(library) is None:
            raise SystemExit(f"expected {library} to compare with, found none: install the extra `parity` (make test-parity does)")
    rows = [encoder.compare(patch, batch=options.batch, rounds=options.rounds) for patch in options.patches]
    return {
        "headline": {
            "torch_over_jax": rows[-1]["torch_over_jax"]["median"],
            "gradient_difference": max(row["gradient_difference"] for row in rows),
        },
        "options": options.__dict__,
        "rows": rows,
    }


def plot(result: dict[str, Any], path: Path) -> None:
    """Seconds of a call against the difference of the gradients."""
    with sheet(path) as panels:
        for row in result["rows"]:
            for kind, mark in (("jax", "o"), ("torch", "s")):
                error = row["gradient_difference"] if kind == "jax" else 0.0
                panels[0].plot(row[kind]["wall_s"]["median"], error, mark, label=f"{row['model']}, {kind}")
        panels[0].set(xlabel="seconds, forward and gradient", ylabel="difference of the gradient from PyTorch's", title="image tower")

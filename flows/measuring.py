"""`dreamfields bench`: the benchmarks of a checkout, which are no part of the installed package."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import typer

from flows.order import OrderError
from tasks.compiled import keep_compiled


def measure(name: str, arguments: Sequence[str], *, out: Path | None) -> None:
    """Run a benchmark, say its headline and where its JSON and plot are.

    Raises:
      OrderError: there is no such benchmark, or no checkout.
    """
    root = Path(__file__).resolve().parent.parent
    if not (root / "benchmarks" / "command.py").is_file():
        raise OrderError("expected a checkout with its folder benchmarks, got an installed package: run it from a clone of the project")
    keep_compiled()
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    from benchmarks.command import UnknownBenchmark, bench

    try:
        path = bench(name, arguments, folder=out)
    except UnknownBenchmark as error:
        raise OrderError(str(error)) from None
    for key, value in json.loads(path.read_text(encoding="utf-8"))["headline"].items():
        typer.echo(f"{key:28} {'not measured' if value is None else value}")
    typer.echo(f"{path}\n{path.with_suffix('.png')}")

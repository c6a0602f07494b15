"""`dreamfields bench NAME`: options, the run, its JSON and its plot.

A benchmark is a module with `Options` (a frozen dataclass of plain values, whose defaults are the size to report), `run(options)`
and `plot(result, path)`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import shlex
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.record import RESULTS, leave

BENCHMARKS = {
    "step": "one optimisation step, skipping against dense: seconds and gradient",
    "sample": "a sample of the residual network: its waves, its evaluation and gradient, by the size of a chunk",
    "render": "held-out pictures: error against field evaluations and seconds, order of convergence",
    "dream": "whole dreams, skipping against dense and against the hybrid field: seconds and the judge's cosine",
    "mesh": "iso-surface, coarse to fine against the whole lattice: evaluations, seconds, error",
    "assets": "finished meshes of real fields: closed, valid, the same in every format, like their fields (needs the extra `test`)",
    "encoder": "image tower forward and gradient, against PyTorch (needs the extra `parity`)",
    "store": "checkpoints and artifacts: bytes a second, and how long the optimisation waits",
    "report": "the page of a sweep over a thousand cached objects: seconds from the store to the page",
}
"""Name -> what it measures."""

MODULES = {"encoder": "towers"}
"""Where the module is not named like the benchmark."""


class UnknownBenchmark(ValueError):
    """No such benchmark; the text is one sentence with the way out."""


def bench(name: str, arguments: Sequence[str], *, folder: Path | None = None) -> Path:
    """Run one benchmark; the path of its JSON.

    folder: where results go; `benchmarks/results` if None.

    Raises:
      UnknownBenchmark: one sentence. SystemExit: arguments that its options do not know.
    """
    if name not in BENCHMARKS:
        raise UnknownBenchmark(f'expected a benchmark among {", ".join(BENCHMARKS)}, got "{name[:40]}"')
    module = import_module(f"benchmarks.{MODULES.get(name, name)}")
    options = read_options(name, module.Options, arguments)
    result = module.run(options)
    command = shlex.join(["dreamfields", "bench", name, *arguments])
    path = leave(name, result, command=command, folder=folder or RESULTS)
    module.plot(json.loads(path.read_text(encoding="utf-8")), path.with_suffix(".png"))
    return path


def read_options(name: str, kind: type[Any], arguments: Sequence[str]) -> Any:
    """`--size 88` for the field `size`; several values where the default is a tuple."""
    parser = argparse.ArgumentParser(prog=f"dreamfields bench {name}", description=BENCHMARKS[name])
    for option in dataclasses.fields(kind):
        default: Any = option.default
        several = isinstance(default, tuple)
        example = default[0] if several else default
        shown = " ".join(map(str, default)) if several else default
        flag = f"--{option.name.replace('_', '-')}"
        parser.add_argument(flag, type=type(example), nargs="*" if several else None, default=default, help=f"default: {shown}")
    given = vars(parser.parse_args(list(arguments)))
    return kind(**{key: tuple(value) if isinstance(value, list) else value for key, value in given.items()})

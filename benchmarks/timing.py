"""Seconds of several ways to do one thing, taking turns: what else the machine does falls on all of them.

Two clocks. Wall seconds are what a user waits; processor seconds, added up over all cores, are what the work costs, and hold on a
machine that is shared with other work. Ratios are taken round by round.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.record import Result, spread

Way = Callable[[int], Any]
"""Round -> whatever is to be waited for."""


@dataclass
class Times:
    """One way's seconds, a number a round."""

    wall: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)

    def add(self, work: Callable[[], Any]) -> Any:
        """Take the time of one call, until its arrays are there; what it gave."""
        wall, processor = time.perf_counter(), time.process_time()
        made = jax.block_until_ready(work())
        self.processor.append(time.process_time() - processor)
        self.wall.append(time.perf_counter() - wall)
        return made

    def row(self) -> Result:
        """Both clocks with their spread."""
        return {"wall_s": spread(self.wall), "processor_s": spread(self.processor)}


def take_turns(ways: Mapping[str, Way], *, rounds: int) -> dict[str, Times]:
    """Every way once a round, in an order that turns round each time; all are compiled before by a call of round 0."""
    for way in ways.values():
        jax.block_until_ready(way(0))
    taken = {name: Times() for name in ways}
    for turn in range(rounds):
        for name in list(ways)[:: -1 if turn % 2 else 1]:
            taken[name].add(partial(ways[name], turn))
    return taken


def ratio(slow: Times, fast: Times) -> Result:
    """How many times longer `slow` takes, on both clocks, with spread over the rounds."""
    return {
        clock: spread([a / b for a, b in zip(getattr(slow, clock), getattr(fast, clock), strict=True)]) for clock in ("wall", "processor")
    }


def matrix_rate(*, side: int = 1024, rounds: int = 5) -> Result:
    """What a plain float32 matrix product reaches here, GFLOP a second of the wall clock and of the processor's."""
    matrix = jnp.asarray(np.random.default_rng(0).normal(size=(side, side)), jnp.float32)
    product = jax.jit(lambda a: a @ a)
    taken = take_turns({"product": lambda turn: product(matrix)}, rounds=rounds)["product"]
    flop = 2.0 * side**3 / 1e9
    return {"wall": spread([flop / each for each in taken.wall]), "processor": spread([flop / max(each, 1e-9) for each in taken.processor])}

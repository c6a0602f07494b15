"""Several dreams in one compiled program: the same configuration, other seeds, and other captions if wanted.

A device that one dream leaves half idle takes several in the time of little more than one. They walk in step: the number of steps is
the one thing that they share, so that what is done every so many steps is still done only then.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from dreamfields_core.dreaming.program import DreamProgram, Metrics
from dreamfields_core.dreaming.state import DreamState
from dreamfields_core.types import Array


class SeedsProgram:
    """The step of `program` for S seeds at once, on one device.

    States are stacked: every leaf but `step` has S in front. `start` gives them, `step` moves them, `state_of` takes one out, which
    is the state that `program` alone, with that seed, would have but for rounding.

    Raises:
      ValueError: no seeds, or a program whose rays are shared by several devices.
    """

    def __init__(self, program: DreamProgram, seeds: Sequence[int]) -> None:
        if not seeds:
            raise ValueError("expected at least one seed, got none")
        if program.mesh is not None:
            raise ValueError(f"expected a program on one device for several seeds, got {program.mesh.size}: set render.devices to 1")
        self.program = program
        self.keys = jax.vmap(jax.random.key)(jnp.asarray(seeds, jnp.uint32))
        axes: dict[str, Any] = {"params": 0, "opt_state": 0, "origin": 0, "occupancy": 0, "rate_scale": 0, "bad": 0}
        stacked = DreamState(**axes | {"step": None})
        self._start = jax.jit(jax.vmap(program.start_from, out_axes=stacked))
        several = jax.vmap(program.advance, in_axes=(stacked, 0, None, 0), out_axes=(stacked, 0))
        self._step = jax.jit(several, donate_argnums=0)

    def start(self) -> DreamState:
        """The states before the first step."""
        return self._start(self.keys)

    def step(self, states: DreamState, text_embeddings: Array) -> tuple[DreamState, Metrics]:
        """Take one step with every seed; `states` are consumed.

        Args:
          text_embeddings: [S, ...], for each seed what `DreamProgram.step` takes.

        Returns:
          The states, and metrics [S] each. One seed's step that is not finite holds none of the others up.
        """
        return self._step(states, self.keys, self.program.encoder.params, text_embeddings)


def state_of(states: DreamState, number: int) -> DreamState:
    """The state of one of the seeds, by its place among them."""
    alone: DreamState = jax.tree.map(lambda leaf: leaf[number], states.replace(step=states.rate_scale))  # type: ignore[attr-defined]
    return alone.replace(step=states.step)  # type: ignore[attr-defined, no-any-return]

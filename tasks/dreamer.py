"""The optimisation from one checkpoint to the next: executed steps, saves, roll-backs, and a stop that loses nothing.

Everything that decides what happens next is in the checkpoint, so a run that was stopped at any instant ends with the same
bits as one that was not: the state, the history, the glimpses, and the anchor, the last regular checkpoint that was sound, to which a
roll-back returns. Metrics are read some steps late, so that the device never waits for the host.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.config import DreamConfig
from dreamfields_core.dreaming.program import DreamProgram, Metrics
from dreamfields_core.dreaming.settling import has_settled, is_looked_at
from dreamfields_core.dreaming.state import DreamState, state_from_arrays, state_to_arrays
from dreamfields_core.types import Array
from storage.checkpoints import CheckpointWriter, latest_checkpoint
from storage.contract import Store
from storage.saver import AsyncSaver

LAG = 2
"""Steps between a step's launch and the reading of its metrics."""
GLIMPSES = 10
"""Pictures from the held-out view in the course of a dream, so that a judge can say afterwards how it went."""
ROLL_BACKS = 4
"""Each halves the rate; after so many a run is given up."""

Tell = Callable[..., None]
Arrays = dict[str, np.ndarray]


class DreamFailed(RuntimeError):
    """Steps that stay non-finite; the text has the numbers and the way out."""


class Dreamer:
    """One run of the optimisation. `tell(event, **facts)` hears of every step, save and roll-back."""

    def __init__(self, program: DreamProgram, embedding: Array, store: Store, run: str, tell: Tell) -> None:
        self.program, self.embedding, self.store, self.run, self.tell = program, embedding, store, run, tell
        self.config: DreamConfig = program.config
        self.history: list[dict[str, float]] = []
        self.glimpses: dict[int, np.ndarray] = {}
        self.unread: deque[Metrics] = deque()
        self.template: DreamState = jax.eval_shape(program.start)
        self.saved, self._before, self._begun = 0, 0.0, time.monotonic()
        if not self._resume():
            self.state = program.start()
            self.anchor = self.arrays()
        self.saver = self._open()

    @property
    def step(self) -> int:
        """Steps taken."""
        return len(self.history) + len(self.unread)

    @property
    def finished(self) -> bool:
        return self.step >= self.config.optim.steps or self.settled

    @property
    def settled(self) -> bool:
        """Whether there is nothing more to gain; decided from the history, which checkpoints keep."""
        if self.unread or not is_looked_at(self.step, self.config.optim):
            return False
        return has_settled([row["similarity"] for row in self.history], self.config.optim, self.config.loss)

    @property
    def seconds(self) -> float:
        """Spent so far, by the processes before this one too."""
        return round(self._before + time.monotonic() - self._begun, 3)

    def advance(self) -> None:
        """Take one step, and save if one is due.

        Raises: DreamFailed, StorageError.
        """
        self.state, metrics = self.program.step(self.state, self.embedding)
        self.unread.append(metrics)
        if self.step % max(1, self.config.optim.steps // GLIMPSES) == 0:
            self.glimpses[self.step] = self.program.glimpse(self.state)
        optim = self.config.optim
        due = self.step >= optim.steps or self.step % optim.checkpoint_every == 0
        if self._read(leave=0 if due or is_looked_at(self.step, optim) else LAG) and (due or self.settled):
            self._checkpoint()
            if self.settled and self.step < optim.steps:
                self.tell("note", text=f"the similarity has settled: done after {self.step} of {optim.steps} steps")

    def stop(self) -> None:
        """Save where it stands, however odd the step."""
        self._read(leave=0)
        self._save()
        self.close()

    def close(self) -> None:
        """Wait for the save under way. Raises: StorageError."""
        self._settle()
        self.saver.close()

    def arrays(self) -> Arrays:
        """The state on the host, in copies: its own buffers are given away at the next step."""
        return {name: np.array(value, copy=True) for name, value in state_to_arrays(self.state).items()}

    def _read(self, *, leave: int) -> bool:
        """Read metrics until so many are left; False when they led to a roll-back."""
        while len(self.unread) > leave:
            row = {name: float(value) for name, value in jax.device_get(self.unread.popleft()).items()}
            self.history.append(row)
            self.tell("step", step=len(self.history), **row)
            if row["bad"] >= self.config.optim.patience:
                self._roll_back(row)
                return False
        return True

    def _checkpoint(self) -> None:
        if self.history[-1]["bad"] == 0:
            self.anchor = self.arrays() | {"anchored": np.asarray(self.step)}
        self._save()

    def _save(self) -> None:
        """Hand the state to the saver, with the anchor where it is another."""
        if self.step == self.saved:
            return
        self._settle()
        arrays = {f"state/{name}": value for name, value in self.arrays().items()}
        arrays |= {f"history/{name}": self._column(name) for name in (self.history[0] if self.history else {})}
        arrays |= {f"glimpses/{step}": picture for step, picture in self.glimpses.items()}
        if self._anchored != self.step:
            arrays |= {f"anchor/{name}": value for name, value in self.anchor.items()}
        self.saver.save(self.step, arrays, {"step": self.step, "seconds": self.seconds})
        self.saved = self.step

    def _settle(self) -> None:
        manifest = self.saver.wait()
        if manifest is not None:
            self.tell("saved", step=manifest.step)

    def _resume(self) -> bool:
        """Go on from the newest good checkpoint; False when there is none."""
        checkpoint = latest_checkpoint(self.store, self.run)
        if checkpoint is None:
            return False
        groups: dict[str, Arrays] = {"state": {}, "anchor": {}, "history": {}, "glimpses": {}}
        for name, value in checkpoint.arrays.items():
            group, _, rest = name.partition("/")
            groups[group][rest] = value
        self.state = state_from_arrays(self.template, groups["state"])
        self.anchor = groups["anchor"] or groups["state"] | {"anchored": np.asarray(checkpoint.step)}
        names, columns = list(groups["history"]), [column.tolist() for column in groups["history"].values()]
        self.history = [dict(zip(names, row)) for row in zip(*columns)]
        self.glimpses = {int(step): groups["glimpses"][step] for step in sorted(groups["glimpses"], key=int)}
        self.saved, self._before = checkpoint.step, float(checkpoint.metadata["seconds"])
        self.tell("resumed", step=checkpoint.step)
        return True

    def _roll_back(self, row: dict[str, float]) -> None:
        scale = float(self.state.rate_scale) / 2
        if scale < 0.5**ROLL_BACKS:
            numbers = ", ".join(f"{name} {value:.4g}" for name, value in row.items())
            raise DreamFailed(
                f"expected finite steps, but step {len(self.history)} is not finite after {ROLL_BACKS} roll-backs ({numbers}): "
                "lower optim.rate or loss.transmittance"
            )
        bad_at, self.unread = len(self.history), deque()
        sound = state_from_arrays(self.template, {name: value.copy() for name, value in self.anchor.items()})
        self.state = replace(sound, rate_scale=jnp.full_like(sound.rate_scale, scale), bad=jnp.zeros_like(sound.bad))
        self.history = self.history[: self._anchored]
        self.glimpses = {step: picture for step, picture in self.glimpses.items() if step <= self._anchored}
        self.saver.close()
        self.saver = self._open()
        self.saved = self._anchored
        self.tell("rolled_back", step=bad_at, to=self._anchored, rate_scale=scale)

    def _open(self) -> AsyncSaver:
        return AsyncSaver(CheckpointWriter(self.store, self.run))

    @property
    def _anchored(self) -> int:
        return int(self.anchor.get("anchored", 0))

    def _column(self, name: str) -> np.ndarray:
        return np.asarray([row[name] for row in self.history], np.float32)

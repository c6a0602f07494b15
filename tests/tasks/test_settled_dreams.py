"""A dream that ends early ends at the same step with the same bits, however often it was stopped on the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.dreaming.state import DreamState
from storage.checkpoints import latest_checkpoint
from storage.contract import Store
from storage.store import open_store
from tasks.dreamer import Dreamer
from tests.tasks.stand_in import StandIn
from tests.tasks.tiny import tiny

TEXT = jnp.asarray([0.6, 0.8])
CONFIG = tiny("optim.steps=60", "optim.checkpoint_every=11", "optim.settle_window=4", "optim.settle_gain=0.05", "loss.anneal_steps=5")


class Learner(StandIn):
    """A stand-in whose similarity rises ever more slowly."""

    def _step(self, state: DreamState, text: jax.Array) -> tuple[DreamState, dict[str, jax.Array]]:
        after, metrics = super()._step(state, text)
        return after, metrics | {"similarity": 1.0 - jnp.exp(-after.step / 8.0) + 1e-3 * jnp.sin(after.step * 1.0)}


def run(store: Store, said: list[tuple[str, dict[str, Any]]] | None = None) -> Dreamer:
    told = said if said is not None else []
    return Dreamer(Learner(CONFIG), TEXT, store, "run", lambda event, **facts: told.append((event, facts)))  # type: ignore[arg-type]


def to_the_end(dreamer: Dreamer) -> Dreamer:
    while not dreamer.finished:
        dreamer.advance()
    dreamer.close()
    return dreamer


def bits(dreamer: Dreamer) -> dict[str, bytes]:
    rows = {f"row/{name}": np.asarray([row[name] for row in dreamer.history]) for name in dreamer.history[0]}
    return {name: array.tobytes() for name, array in (dreamer.arrays() | rows).items()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Dreamer:
    said: list[tuple[str, dict[str, Any]]] = []
    store = open_store(tmp_path_factory.mktemp("whole"))
    dreamer = to_the_end(run(store, said))
    notes = [facts["text"] for event, facts in said if event == "note"]
    assert notes == [f"the similarity has settled: done after {dreamer.step} of 60 steps"]
    assert latest_checkpoint(store, "run").step == dreamer.step  # type: ignore[union-attr]
    return dreamer


def test_it_ends_between_annealing_and_the_last_step(whole: Dreamer) -> None:
    assert 13 <= whole.step < 60 and whole.step % 4 == 0
    assert int(whole.state.step) == whole.step == len(whole.history)


@pytest.mark.parametrize("stops", [(3,), (12, 13), (16, 20, 21)])
def test_stopped_and_resumed_it_ends_the_same(tmp_path: Path, whole: Dreamer, stops: tuple[int, ...]) -> None:
    store = open_store(tmp_path)
    for stop in stops:
        dreamer = run(store)
        while dreamer.step < stop and not dreamer.finished:
            dreamer.advance()
        dreamer.stop()
    assert bits(to_the_end(run(store))) == bits(whole)


def test_a_finished_dream_that_is_opened_again_is_finished(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    ended = to_the_end(run(store)).step
    again = run(store)
    assert again.finished and again.step == ended
    again.close()

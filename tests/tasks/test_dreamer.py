"""The optimisation between two checkpoints: the same bits however it is stopped, and a way back from steps that go wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from storage.checkpoints import latest_checkpoint, manifest_keys
from storage.contract import Store
from storage.errors import StorageFull
from storage.local import LocalStore
from storage.store import open_store
from tasks.dreamer import LAG, ROLL_BACKS, Dreamer, DreamFailed
from tests.tasks.stand_in import StandIn
from tests.tasks.tiny import tiny

TEXT = jnp.asarray([0.6, 0.8])
CONFIG = tiny("optim.steps=23", "optim.checkpoint_every=5", "optim.patience=3")


class Run:
    """A dreamer over a stand-in program, and what it said."""

    def __init__(self, store: Store, **bad: Any) -> None:
        self.said: list[tuple[str, dict[str, Any]]] = []
        self.dreamer = Dreamer(StandIn(CONFIG, **bad), TEXT, store, "run", lambda event, **facts: self.said.append((event, facts)))  # type: ignore[arg-type]

    def go(self, steps: int = 10**6) -> Run:
        """So many steps, or to the end."""
        for _ in range(steps):
            if self.dreamer.finished:
                self.dreamer.close()
                break
            self.dreamer.advance()
        return self

    def facts(self, event: str) -> list[dict[str, Any]]:
        return [facts for name, facts in self.said if name == event]

    def result(self) -> dict[str, np.ndarray]:
        """Everything that a later step or a file is made of."""
        rows = {f"row/{name}": np.asarray([row[name] for row in self.dreamer.history]) for name in self.dreamer.history[0]}
        return self.dreamer.arrays() | rows | {f"glimpse/{step}": picture for step, picture in self.dreamer.glimpses.items()}


def same(a: Run, b: Run) -> bool:
    first, second = a.result(), b.result()
    return first.keys() == second.keys() and all(first[name].tobytes() == second[name].tobytes() for name in first)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store")


def test_a_run_saves_on_time_and_at_its_end(store: Store) -> None:
    run = Run(store).go()
    assert [facts["step"] for facts in run.facts("saved")] == [5, 10, 15, 20, 23]
    assert [facts["step"] for facts in run.facts("step")] == list(range(1, 24))
    assert int(run.dreamer.state.step) == 23
    assert latest_checkpoint(store, "run").step == 23  # type: ignore[union-attr]


@pytest.mark.parametrize("steps", [1, 4, 5, 6, 12, 22])
def test_stopped_anywhere_it_ends_with_the_same_bits(tmp_path: Path, steps: int) -> None:
    store = open_store(tmp_path / "stopped")
    Run(store).go(steps).dreamer.stop()
    resumed = Run(store)
    assert resumed.facts("resumed") == [{"step": steps}]
    assert resumed.go().facts("step")[0]["step"] == steps + 1
    assert same(resumed, Run(open_store(tmp_path / "whole")).go())


@pytest.mark.parametrize("steps", [3, 7, 11])
def test_killed_anywhere_it_goes_on_from_its_checkpoint(tmp_path: Path, steps: int) -> None:
    store = open_store(tmp_path / "killed")
    Run(store).go(steps).dreamer.close()  # the save under way ends, no other is made
    resumed = Run(store).go()
    assert resumed.facts("step")[0]["step"] == steps // 5 * 5 + 1
    assert same(resumed, Run(open_store(tmp_path / "whole")).go())


def test_metrics_are_read_late(store: Store) -> None:
    run = Run(store).go(4)
    assert len(run.facts("step")) == 4 - LAG


def test_a_flipped_byte_in_the_newest_checkpoint_costs_the_steps_since_the_one_before(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store = LocalStore(tmp_path / "flipped")
    Run(store).go(12).dreamer.stop()
    newest = sorted((store.root / "runs/run/ckpt").iterdir())[-1]
    data = bytearray(newest.read_bytes())
    data[len(data) // 2] ^= 4
    newest.write_bytes(bytes(data))
    resumed = Run(store)
    assert resumed.facts("resumed") == [{"step": 10}]
    assert "passed over" in caplog.text
    assert same(resumed.go(), Run(open_store(tmp_path / "whole")).go())


def test_bad_steps_lead_back_to_the_last_sound_checkpoint_with_half_the_rate(store: Store) -> None:
    run = Run(store, bad_from=12, cured_below=0.3).go()
    assert run.facts("rolled_back") == [{"step": 15, "to": 10, "rate_scale": 0.5}, {"step": 15, "to": 10, "rate_scale": 0.25}]
    assert int(run.dreamer.state.step) == 23 and len(run.dreamer.history) == 23
    assert list(run.dreamer.glimpses) == list(range(2, 24, 2)), "those of the steps that were taken back were taken again"
    assert float(run.dreamer.state.rate_scale) == 0.25
    assert all(np.isfinite(row["loss"]) for row in run.dreamer.history)


def test_bad_steps_before_the_first_checkpoint_lead_back_to_the_start(store: Store) -> None:
    run = Run(store, bad_from=1, cured_below=0.6).go()
    assert run.facts("rolled_back") == [{"step": 4, "to": 0, "rate_scale": 0.5}]
    assert len(run.dreamer.history) == 23


@pytest.mark.parametrize("steps", [13, 14, 17, 21])
def test_stopped_among_bad_steps_it_ends_with_the_same_bits(tmp_path: Path, steps: int) -> None:
    store, bad = open_store(tmp_path / "stopped"), {"bad_from": 12, "cured_below": 0.3}
    Run(store, **bad).go(steps).dreamer.stop()
    assert same(Run(store, **bad).go(), Run(open_store(tmp_path / "whole"), **bad).go())


def test_a_run_that_cannot_be_saved_fails_with_its_numbers(store: Store) -> None:
    run = Run(store, bad_from=7)
    with pytest.raises(DreamFailed, match=r"step 10 is not finite after 4 roll-backs \(bad 3, loss nan, .*\): lower optim.rate"):
        run.go()
    assert len(run.facts("rolled_back")) == ROLL_BACKS


def test_a_full_disk_leaves_earlier_checkpoints(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(store).go(11)
    run.dreamer.saver.wait()

    def full(key: str, data: bytes) -> None:
        raise StorageFull("Expected room for 9 bytes, got a full disk: free some space.")

    monkeypatch.setattr(store, "put", full)
    with pytest.raises(StorageFull, match="full disk"):
        run.go()
    monkeypatch.undo()
    assert len(manifest_keys(store, "run")) == 2
    assert Run(store).facts("resumed") == [{"step": 10}]

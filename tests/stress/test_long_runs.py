"""Ten thousand steps at ten times the rate, and numbers that are none thrown in at random: the parameters stay numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import DreamState
from storage.store import open_store
from tasks.dreamer import Dreamer
from tests.dreaming.test_program import ENCODER, FIELDS, TEXT, config_of

pytestmark = pytest.mark.slow

TENFOLD = {"optim": {"steps": 10_000, "rate_start": 0.2, "rate": 0.2, "warmup_steps": 0}}


@pytest.mark.parametrize("field", FIELDS)
def test_ten_thousand_steps_at_ten_times_the_rate(field: str) -> None:
    program = DreamProgram(config_of(field, **TENFOLD), ENCODER)

    @jax.jit
    def walk(state: DreamState) -> tuple[DreamState, dict]:
        return jax.lax.scan(lambda state, _: program.advance(state, jax.random.key(0), ENCODER.params, TEXT), state, length=500)

    state = program.start()
    for _ in range(20):
        state, rows = walk(state)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(state))
    assert int(state.step) == 10_000
    # Steps were taken, not refused: one that is not finite leaves everything as it is, and would pass for sound.
    assert np.mean(np.asarray(rows["bad"]) > 0) < 0.01


class Faulty:
    """A program some of whose steps go wrong: `through` says where what is not a number comes in."""

    def __init__(self, program: DreamProgram, *, through: str, at: set[int]) -> None:
        self.program, self.config, self.through = program, program.config, through
        self.at, self.taken = at, 0
        self.start, self.preview, self.glimpse = program.start, program.preview, program.glimpse

    def step(self, state: DreamState, text: Any) -> tuple[DreamState, Any]:
        self.taken += 1
        if self.taken not in self.at:
            return self.program.step(state, text)
        if self.through == "field":  # and it stays there: only going back helps
            state = replace(state, params=jax.tree.map(lambda leaf: jnp.full_like(leaf, jnp.nan), state.params))
            return self.program.step(state, text)
        sound = self.program.encoder
        self.program.encoder = replace(sound, params=jnp.full_like(sound.params, jnp.nan))
        try:
            return self.program.step(state, text)
        finally:
            self.program.encoder = sound


@pytest.mark.parametrize("through", ["encoder", "field"])
def test_what_is_not_a_number_is_survived(tmp_path: Path, through: str) -> None:
    steps = {"steps": 60, "rate_start": 2e-2, "rate": 2e-2, "warmup_steps": 0, "checkpoint_every": 10, "patience": 3}
    config = config_of("hybrid", optim=steps)
    rng = np.random.default_rng(5)
    # Through the encoder never twice in a row; through the field once early and once late, as it takes some steps to be noticed.
    apart = rng.choice(np.arange(2, 55, 2), size=12, replace=False) if through == "encoder" else rng.integers([5, 30], [20, 50])
    at = set(apart.tolist())
    faulty, said = Faulty(DreamProgram(config, ENCODER), through=through, at=at), []
    dreamer = Dreamer(faulty, TEXT, open_store(tmp_path), "run", lambda event, **facts: said.append((event, facts)))  # type: ignore[arg-type]
    while not dreamer.finished:
        dreamer.advance()
    dreamer.close()
    arrays = dreamer.arrays()
    assert all(np.isfinite(array).all() for array in arrays.values())
    bad = [facts for event, facts in said if event == "step" and facts["bad"]]
    back = [facts for event, facts in said if event == "rolled_back"]
    assert len(bad) >= len(at)
    if through == "encoder":
        # Each one costs its own step; so many in a row that the run goes back are not among these.
        assert len(bad) == len(at) and not back and int(arrays["step"]) == 60
    else:
        assert len(back) == len(at) and float(arrays["rate_scale"]) == 0.5 ** len(at)
    rows = [facts for event, facts in said if event == "step"]
    assert np.mean([row["similarity"] for row in rows[-5:]]) > np.mean([row["similarity"] for row in rows[:1]])

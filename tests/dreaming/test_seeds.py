"""Several dreams in one program: each is the one that it would be alone."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.seeds import SeedsProgram, state_of
from dreamfields_core.dreaming.state import state_to_arrays
from tests.dreaming.test_program import ENCODER, TEXT, config_of

SEEDS = (0, 7, 2**32 - 1)
STEPS = 10
"""The occupancy grid is in use from step 8 on."""


@pytest.mark.slow
def test_each_seed_dreams_as_it_would_alone() -> None:
    alone = DreamProgram(config_of("hybrid"), ENCODER)
    together = SeedsProgram(alone, SEEDS)
    texts = jnp.stack([TEXT, -TEXT, jnp.roll(TEXT, 1)])
    states, rows = together.start(), []
    for _ in range(STEPS):
        states, metrics = together.step(states, texts)
        rows.append(jax.device_get(metrics))
    assert int(states.step) == STEPS and states.origin.shape == (len(SEEDS), 3)
    for number, seed in enumerate(SEEDS):
        program = DreamProgram(alone.config.model_copy(update={"seed": seed}), ENCODER)
        state = program.start()
        start = {name: array.copy() for name, array in state_to_arrays(state).items()}
        for step in range(STEPS):
            state, metrics = program.step(state, texts[number])
            for name, value in metrics.items():
                # Batched products add in another order; Adam passes a rounding on to the next step.
                assert float(rows[step][name][number]) == pytest.approx(float(value), rel=2e-4, abs=2e-5 * (step + 1)), (seed, step, name)
        own, shared = state_to_arrays(state), state_to_arrays(state_of(states, number))
        assert own.keys() == shared.keys()
        for name, value in own.items():
            assert (value.shape, value.dtype) == (shared[name].shape, shared[name].dtype)
            if name.startswith("params"):
                moved = np.linalg.norm(value - start[name])
                assert np.linalg.norm(value - shared[name]) <= 5e-3 * moved + 1e-6, (seed, name)
    # Its seed's own dream, and nobody else's.
    assert len({float(loss) for loss in rows[0]["loss"]}) == len(SEEDS)


@pytest.mark.slow
def test_a_step_that_is_not_finite_holds_nobody_else_up() -> None:
    together = SeedsProgram(DreamProgram(config_of("hybrid"), ENCODER), SEEDS)
    before = together.start()
    grid = np.array(before.params["grids"]["grid4"], copy=True)
    states, metrics = together.step(before, jnp.stack([TEXT, jnp.full_like(TEXT, jnp.nan), TEXT]))
    np.testing.assert_array_equal(metrics["bad"], [0, 1, 0])
    np.testing.assert_array_equal(states.params["grids"]["grid4"][1], grid[1])
    assert all(np.any(np.asarray(states.params["grids"]["grid4"][number]) != grid[number]) for number in (0, 2))


def test_no_seeds_are_refused() -> None:
    with pytest.raises(ValueError, match="expected at least one seed, got none"):
        SeedsProgram(DreamProgram(config_of("hybrid"), ENCODER), ())

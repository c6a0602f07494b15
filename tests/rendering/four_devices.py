"""Run by test_sharding.py in a process of its own, where four devices are simulated: prints what one and what four of them give."""

from __future__ import annotations

import json

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import state_from_arrays, state_to_arrays
from tests.dreaming.test_program import ENCODER, TEXT, config_of

FIELD, STEPS = "hybrid", 12
"""So many that the occupancy grid is in use: it is refreshed from step 8 on."""


def dream(devices: int) -> dict:
    """A short dream: metrics of each step, and how far each parameter went from where it started."""
    config = config_of(FIELD)
    skip = config.render.skip.model_copy(update={"learn": 0.3, "refresh_turns": 2})
    render = config.render.model_copy(update={"devices": devices, "skip": skip})
    program = DreamProgram(config.model_copy(update={"render": render}), ENCODER)
    start = state_to_arrays(program.start())
    state, rows = program.start(), []
    for step in range(STEPS):
        if step == STEPS // 2:  # as a resumed run: from arrays on the host
            state = state_from_arrays(program.start(), {name: array.copy() for name, array in state_to_arrays(state).items()})
        state, metrics = program.step(state, TEXT)
        rows.append({name: float(value) for name, value in metrics.items()})
    after = state_to_arrays(state)
    compiled = program._step._cache_size()
    moved = {name: np.asarray(after[name] - start[name], np.float64).ravel().tolist() for name in after if name.startswith("params")}
    return {"mesh": program.mesh.size if program.mesh else 1, "rows": rows, "moved": moved, "compiled": compiled}


def refusals() -> list[str]:
    said = []
    for devices in (3, 8):
        try:
            dream(devices)
        except ValueError as error:
            said.append(str(error))
    return said


def main() -> None:
    assert len(jax.devices()) == 4 and jnp.zeros(()).dtype == jnp.float32
    free = DreamProgram(config_of(FIELD), ENCODER).mesh
    assert free is not None and free.size == 4, "all devices are taken where nothing else is said"
    print(json.dumps({"one": dream(1), "four": dream(4), "refusals": refusals()}))


if __name__ == "__main__":
    main()

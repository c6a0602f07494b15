"""A program that stands in for the real one where only the order of things matters."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.config import DreamConfig
from dreamfields_core.dreaming.state import DreamState
from dreamfields_core.rendering.occupancy import unknown_occupancy


class StandIn:
    """A program whose step is arithmetic: state and randomness as the real one has them.

    `bad_from`: steps from there on are not finite, unless the rate has been scaled below `cured_below`.
    """

    def __init__(self, config: DreamConfig, *, bad_from: int = 10**9, cured_below: float = 0.0) -> None:
        self.config = config
        self._bad_from, self._cured_below = bad_from, cured_below
        self.step = jax.jit(self._step, donate_argnums=0)

    def start(self) -> DreamState:
        """All zeros, but for what is one."""
        return DreamState(
            step=jnp.zeros((), jnp.int32),
            params={"grid": jnp.ones((4, 5)), "net": [jnp.zeros(3)]},
            opt_state={"mu": jnp.zeros((4, 5))},
            origin=jnp.zeros(3),
            occupancy=unknown_occupancy(2),
            rate_scale=jnp.ones(()),
            bad=jnp.zeros((), jnp.int32),
        )

    def _step(self, state: DreamState, text: jax.Array) -> tuple[DreamState, dict[str, jax.Array]]:
        noise = jax.random.normal(jax.random.fold_in(jax.random.key(self.config.seed), state.step), (4, 5))
        finite = (state.step < self._bad_from) | (state.rate_scale < self._cured_below)
        mu = 0.9 * state.opt_state["mu"] + noise * text.sum()
        grid = state.params["grid"] + 0.1 * state.rate_scale * mu
        keep = partial(jnp.where, finite)
        after = state.replace(  # type: ignore[attr-defined]
            step=state.step + 1,
            params={"grid": keep(grid, state.params["grid"]), "net": [state.params["net"][0] + keep(1.0, 0.0)]},
            opt_state={"mu": keep(mu, state.opt_state["mu"])},
            bad=keep(0, state.bad + 1),
        )
        return after, {"loss": keep(grid.sum(), jnp.nan), "transmittance": keep(grid.mean(), jnp.nan), "bad": after.bad}

    def glimpse(self, state: DreamState) -> np.ndarray:
        """Tells which step it was taken at, and of which state."""
        return np.full((2, 2, 3), int(state.step) + int(jnp.abs(state.params["grid"]).sum()) % 50, np.uint8)

    def preview(self, state: DreamState) -> np.ndarray:
        """Grey."""
        return np.full((8, 8, 3), 128, np.uint8)

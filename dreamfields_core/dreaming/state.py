"""All that a dream remembers between two steps; randomness is a function of seed and step, so nothing hidden has to be saved."""

from __future__ import annotations

import flax.struct
import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.rendering.occupancy import Occupancy
from dreamfields_core.types import Array, Params


@flax.struct.dataclass
class DreamState:
    """step: [] int32, steps taken. params: of the field. opt_state: Adam's moments. origin: [3] of the scene. occupancy: where
    the scene is. rate_scale: [] factor on the learning rate, below 1 after a roll-back. bad: [] int32, non-finite steps in a row.
    """

    step: Array
    params: Params
    opt_state: Params
    origin: Array
    occupancy: Occupancy
    rate_scale: Array
    bad: Array


class StateMismatch(ValueError):
    """Saved arrays that do not belong to this configuration."""


def state_to_arrays(state: DreamState) -> dict[str, np.ndarray]:
    """The state as flat, named host arrays."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(state)
    return {_name(path): np.asarray(leaf) for path, leaf in leaves}


def state_from_arrays(template: DreamState, arrays: dict[str, np.ndarray]) -> DreamState:
    """The state whose arrays these are.

    Args:
      template: a state of the same configuration, for its structure.

    Raises:
      StateMismatch: a name is missing, or a shape or type differs.
    """

    def pick(path: tuple, leaf: Array) -> Array:
        name = _name(path)
        if name not in arrays:
            raise StateMismatch(f'expected an array "{name}" in the checkpoint, got none: it belongs to another configuration')
        saved = arrays[name]
        if saved.shape != leaf.shape or saved.dtype != leaf.dtype:
            raise StateMismatch(
                f'expected "{name}" as {leaf.dtype}{list(leaf.shape)}, got {saved.dtype}{list(saved.shape)}: '
                "the checkpoint belongs to another configuration"
            )
        return jnp.asarray(saved)

    return jax.tree_util.tree_map_with_path(pick, template)


def _name(path: tuple) -> str:
    return "/".join(str(getattr(entry, "name", getattr(entry, "key", getattr(entry, "idx", entry)))) for entry in path)

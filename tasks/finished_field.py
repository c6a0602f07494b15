"""A finished field as one file: safetensors with the parameters, the origin and the occupancy, the configuration in its header."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import safetensors.numpy

from dreamfields_core.config import DreamConfig, parts, validate
from dreamfields_core.dreaming.state import DreamState, state_from_arrays
from dreamfields_core.fields import Field, build_field
from dreamfields_core.rendering.images import view_renderer
from dreamfields_core.rendering.occupancy import Occupancy, unknown_occupancy
from dreamfields_core.scene.cameras import Pose
from dreamfields_core.types import Array, Params, Rendering
from storage.weights import read_weights

KEPT = ("params", "origin", "occupancy")
READS = ("scene", "field", "render")
MEDIA_TYPE = "application/x-safetensors"


@dataclass(frozen=True)
class FinishedField:
    """field: its functions. params, origin [3], occupancy: what was learned. config: of scene, field and render."""

    field: Field
    params: Params
    origin: Array
    occupancy: Occupancy
    config: DreamConfig


def pack_field(arrays: Mapping[str, np.ndarray], config: DreamConfig) -> bytes:
    """The part of a dream's state that outlives it. The same state gives the same bytes.

    arrays: as `state_to_arrays` gives them.
    """
    kept = {name: np.array(value, order="C") for name, value in arrays.items() if name.split("/")[0] in KEPT}
    # One entry only: the library writes several in random order.
    return bytes(safetensors.numpy.save(kept, {"dreamfields": json.dumps(parts(config, READS), sort_keys=True)}))


def unpack_field(data: bytes) -> FinishedField:
    """The inverse. Raises: UnreadableWeights, ConfigError, StateMismatch."""
    weights = read_weights(data)
    config = validate(json.loads(weights.metadata["dreamfields"]))
    field = build_field(config.field, bound=config.scene.bound)
    template: dict[str, Any] = {
        "params": jax.eval_shape(field.init, jax.random.key(0)),
        "origin": jnp.zeros(3),
        "occupancy": unknown_occupancy(config.render.skip.resolution),
    }
    found = cast(dict[str, Any], state_from_arrays(cast(DreamState, template), weights.arrays))
    return FinishedField(field, found["params"], found["origin"], found["occupancy"], config)


def view_by(dream: FinishedField, *, samples: int) -> Callable[[Pose, int], Rendering]:
    """A function (poses [V], size) -> Rendering of NumPy arrays [V, size, size, ...], compiled once for all sizes."""
    render = view_renderer(
        dream.field,
        dream.params,
        dream.origin,
        dream.occupancy,
        samples=samples,
        bound=dream.config.scene.bound,
        skip=dream.config.render.skip,
    )

    def see(poses: Pose, size: int) -> Rendering:
        views = [render(jax.tree.map(lambda leaf, view=view: leaf[view], poses), size) for view in range(len(poses.azimuth))]
        return jax.tree.map(lambda *leaves: np.stack(leaves), *views)  # type: ignore[no-any-return]

    return see

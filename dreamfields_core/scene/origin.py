"""The scene's origin follows the object (paper section 4.6): an average of the centres of mass seen so far."""

from __future__ import annotations

import jax.numpy as jnp

from dreamfields_core.precision import in_float32
from dreamfields_core.types import Array

SMALLEST_MASS = 1e-6
"""Below this a scene is empty and has no centre."""


def track_origin(origin: Array, mass: Array, moment: Array, *, decay: float) -> Array:
    """One step of the exponential moving average.

    Args:
      origin: [3] so far.
      mass: [] sum of the opacities of a step's samples.
      moment: [3] sum of their positions times their opacities.
      decay: share of the old origin that is kept.

    Returns:
      [3]; the old origin where the scene is empty.
    """
    origin, mass, moment = in_float32((origin, mass, moment))
    filled = mass > SMALLEST_MASS
    center = moment / jnp.where(filled, mass, 1.0)
    return jnp.where(filled, decay * origin + (1.0 - decay) * center, origin)

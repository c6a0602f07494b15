"""The control of a retrieval table: balls in the right colours, at the right places, without the shape of anything.

A judge that cannot tell these from the true things reads colours only, and so would the score.
"""

from __future__ import annotations

import numpy as np

from dreamfields_core.teaching import words
from dreamfields_core.teaching.distances import at, ellipsoid
from dreamfields_core.teaching.parts import Parts, body, part
from dreamfields_core.teaching.staging import Shapes


def _ball(rng: np.random.Generator) -> Parts:
    return body(ellipsoid(0.75, 0.75, 0.75))


def _two_balls(rng: np.random.Generator) -> Parts:
    """The second one in the colour of the part that captions may name."""
    return [*body(at(ellipsoid(0.6, 0.6, 0.6), z0=-0.3)), *part(at(ellipsoid(0.35, 0.35, 0.35), z0=0.55))]


BLOBS: Shapes = {kind: _two_balls if kind in words.PARTS else _ball for kind in words.KINDS}
"""Kind -> its blob: two balls for what has a part of another colour, else one."""

"""Image-text models by name. `embedded` guides, `embedded-judge` judges; both ship with the project and speak a small language.

Published models (CLIP and its kin) join here, behind the same two functions.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from storage.weights import Weights, read_weights, shipped

if TYPE_CHECKING:  # importing it starts JAX, and a card must be cheap
    from dreamfields_core.types import Encoder

SHIPPED = {"embedded": "guide", "embedded-judge": "judge"}
"""Name -> file of weights in the package."""


class EncoderError(ValueError):
    """A model that is not there, or cannot read the caption; the text is one sentence with the way out."""


@dataclass(frozen=True)
class Card:
    """What is known of a model without loading it: its name, the digest of its weights, the side of its pictures in pixels."""

    name: str
    digest: str
    image_size: int


def card(name: str) -> Card:
    """Cheap: JAX is not started. Raises: EncoderError, MissingWeights, UnreadableWeights."""
    weights = _weights(name)
    return Card(name, weights.sha256, int(json.loads(weights.metadata["architecture"])["image_size"]))


def load_encoder(name: str) -> Encoder:
    """The model, ready to use. Raises: EncoderError, MissingWeights, UnreadableWeights."""
    from dreamfields_core.guidance.embedded import from_arrays

    weights = _weights(name)
    try:
        return from_arrays(name, weights.arrays, weights.metadata, weights.sha256)
    except ValueError as error:
        raise EncoderError(str(error)) from error


def unknown_words(name: str, caption: str) -> tuple[str, ...]:
    """The words that the model has never seen; cheap.

    Raises:
      EncoderError: not one word of the caption is known.
    """
    known = set(_weights(name).metadata["vocabulary"].split())
    words = re.findall(r"[a-z0-9]+", caption.lower())
    unknown = tuple(dict.fromkeys(word for word in words if word not in known))
    if len(unknown) == len(set(words)):
        raise EncoderError(
            f'expected a caption with words that "{name}" knows, got "{caption[:60]}": its language is small, '
            'try "a red mushroom", or guide by a published model'
        )
    return unknown


@cache
def _weights(name: str) -> Weights:
    if name not in SHIPPED:
        raise EncoderError(f'expected an image-text model among {", ".join(SHIPPED)}, got "{name}"')
    return read_weights(shipped(SHIPPED[name]))

"""Image-text models by name. `embedded` guides, `embedded-judge` judges; both ship with the project and speak a small language.

Published models (CLIP and its kin, tasks/published.py) stand behind the same functions, and so do several models as one:
"MODEL+MODEL*WEIGHT".
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from os.path import isdir
from typing import TYPE_CHECKING, Any

from dreamfields_core.guidance import registry, shares
from dreamfields_core.guidance.architecture import UnfitModel
from storage.errors import StorageError
from storage.weights import Weights, read_weights, shipped
from tasks.published import BOTH, describe_models, find_published, is_published, load_published

if TYPE_CHECKING:  # importing it starts JAX, and a card must be cheap
    from dreamfields_core.types import Encoder

SHIPPED = {"embedded": "guide", "embedded-judge": "judge"}
"""Name -> file of weights in the package."""


class EncoderError(ValueError):
    """A model that is not there, or cannot read the caption; the text is one sentence with the way out."""


@dataclass(frozen=True)
class Card:
    """What is known of a model without loading it: its name, the digest of its weights, the side of its pictures in pixels.

    members: of an ensemble, the digests that it is made of.
    """

    name: str
    digest: str
    image_size: int
    members: tuple[str, ...] = ()

    def shares_weights(self, other: Card) -> bool:
        """Whether the two are one model, or have one in common."""
        return not {self.digest, *self.members}.isdisjoint({other.digest, *other.members})


def card(name: str) -> Card:
    """JAX is not started; a published model is downloaded on first use. Raises: EncoderError."""
    models = members(name)
    if len(models) > 1:
        cards = [card(member) for member, _ in models]
        digest = shares.digest([(own.digest, weight) for own, (_, weight) in zip(cards, models)])
        return Card(name, digest, max(own.image_size for own in cards), tuple(own.digest for own in cards))
    ((single, _),) = models
    with _one_sentence():
        if is_published(single):
            found = find_published(single)
            return Card(name, found.digest(eight_bits=False), found.arch.pixels.size)
        weights = _weights(single)
        return Card(name, weights.sha256, int(json.loads(weights.metadata["architecture"])["image_size"]))


def load_encoder(name: str, *, towers: Collection[str] = BOTH) -> Encoder:
    """The model, ready to use.

    Args:
      towers: "image", "text" or both: of a published model, a tower that is not needed is not read into memory.

    Raises: EncoderError.
    """
    models = members(name)
    if len(models) > 1:
        from dreamfields_core.guidance.ensemble import ensemble

        return ensemble([(load_encoder(member, towers=towers), weight) for member, weight in models])
    ((single, _),) = models
    with _one_sentence():
        if is_published(single):
            return load_published(single, towers=towers)
    from dreamfields_core.guidance.embedded import from_arrays

    with _one_sentence(ValueError):
        weights = _weights(single)
        return from_arrays(single, weights.arrays, weights.metadata, weights.sha256)


def unknown_words(name: str, caption: str) -> tuple[str, ...]:
    """The words that the model has never seen; cheap. None for published models, whose language is open.

    Raises:
      EncoderError: not one word of the caption is known.
    """
    return tuple(dict.fromkeys(word for member, _ in members(name) for word in _unknown_words(member, caption)))


def members(name: str) -> list[tuple[str, float]]:
    """Models and weights; a model by itself is one of weight 1, and a folder's name may hold any sign. Raises: EncoderError."""
    if not (shares.SIGN in name or shares.SHARE in name) or isdir(name):
        return [(name, 1.0)]
    with _one_sentence(ValueError):
        return shares.split_name(name)


def describe_encoders() -> list[dict[str, Any]]:
    """A row per name, the shipped models first; columns as `describe_models` gives them."""
    rows = []
    for name, file in SHIPPED.items():
        own, size = card(name), shipped(file).stat().st_size
        rows.append(
            {
                "name": name,
                "about": f"ships with the project, small language: {'judges' if file == 'judge' else 'guides'} unless another is named",
                "image_size": own.image_size,
                "megabytes": round(size / 1e6),
                "licence": "Apache-2.0",
                "on_disk": True,
                "from": "the package",
            }
        )
    return rows + describe_models()


def _unknown_words(name: str, caption: str) -> tuple[str, ...]:
    if is_published(name):
        return ()
    known = set(_weights(name).metadata["vocabulary"].split())
    words = re.findall(r"[a-z0-9]+", caption.lower())
    unknown = tuple(dict.fromkeys(word for word in words if word not in known))
    if len(unknown) == len(set(words)):
        raise EncoderError(
            f'expected a caption with words that "{name}" knows, got "{caption[:60]}": its language is small, '
            'try "a red mushroom", or guide by a published model'
        )
    return unknown


@contextmanager
def _one_sentence(*kinds: type[Exception]) -> Iterator[None]:
    """What a model is refused for, or an error of these kinds, is said in the way of the command line."""
    refusals: tuple[type[Exception], ...] = (UnfitModel, StorageError, *kinds)
    try:
        yield
    except EncoderError:
        raise
    except refusals as error:
        text = str(error)
        raise EncoderError(text[:1].lower() + text[1:].rstrip(".")) from error


@cache
def _weights(name: str) -> Weights:
    if name not in SHIPPED:
        near = get_close_matches(name, registry.NAMES, n=3, cutoff=0.4) or ["clip-vit-b16", "siglip2-base-patch32-256"]
        raise EncoderError(
            f"expected an image-text model among {', '.join(SHIPPED)}, published ones such as {', '.join(near)} "
            f'(`dreamfields models` lists all {len(registry.NAMES)}), a folder, or owner/name on the hub, got "{name[:60]}"'
        )
    return read_weights(shipped(SHIPPED[name]))

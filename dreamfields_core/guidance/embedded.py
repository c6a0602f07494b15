"""Our own small image-text models, which ship with the project: arrays in, an `Encoder` out.

All that a model is stands in its arrays and its metadata (str -> str), so nothing here knows how it was taught.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.guidance.resize import resize
from dreamfields_core.guidance.tokens import tell_cut
from dreamfields_core.guidance.towers import Architecture, init, read, see
from dreamfields_core.types import Array, Encoder, Params

FORMAT = "dreamfields-embedded-1"
PADDING, UNKNOWN, FIRST = 0, 1, 2


@dataclass(frozen=True)
class Model:
    """Weights with what is needed to use them: `vocabulary` in the order of the word embedding, after padding and unknown."""

    architecture: Architecture
    vocabulary: tuple[str, ...]
    params: Params


def create(key: Array, vocabulary: Sequence[str], **sizes: Any) -> Model:
    """A model that knows nothing yet; `sizes` are fields of `Architecture`."""
    architecture = Architecture(**sizes, words=len(vocabulary) + FIRST)
    return Model(architecture, tuple(vocabulary), init(key, architecture))


def words_of(caption: str) -> list[str]:
    """Lower case, punctuation dropped.

    Raises:
      ValueError: no word is left.
    """
    found = re.findall(r"[a-z0-9]+", caption.lower())
    if not found:
        raise ValueError(f"expected a caption with at least one word, got {caption!r}: say what should be seen, as in 'a red mug'")
    return found


def tokenizer(vocabulary: Sequence[str], length: int, *, name: str = "this model") -> Callable[[Sequence[str]], np.ndarray]:
    """captions -> int32 [batch, length]; words outside the vocabulary become `UNKNOWN`, longer captions are cut, which is told."""
    index = {word: number for number, word in enumerate(vocabulary, FIRST)}

    def tokenize(captions: Sequence[str]) -> np.ndarray:
        tokens = np.full((len(captions), length), PADDING, np.int32)
        for row, caption in zip(tokens, captions, strict=True):
            words = words_of(caption)
            if len(words) > length:
                tell_cut(name, "words", reads=length, has=len(words), kept=" ".join(words[:length]))
            numbers = [index.get(word, UNKNOWN) for word in words[:length]]
            row[: len(numbers)] = numbers
        return tokens

    return tokenize


def encoder(name: str, model: Model, digest: str) -> Encoder:
    """The model behind the contract of `Encoder`."""
    a, known = model.architecture, frozenset(model.vocabulary)

    def encode_image(params: Params, images: Array) -> Array:
        return see(params, resize(images, a.image_size), a)

    def unknown_words(caption: str) -> tuple[str, ...]:
        return tuple(dict.fromkeys(word for word in words_of(caption) if word not in known))

    return Encoder(
        name=name,
        digest=digest,
        image_size=a.image_size,
        dim=a.dim,
        params=model.params,
        tokenize=tokenizer(model.vocabulary, a.length, name=name),
        encode_text=lambda params, tokens: read(params, jnp.asarray(tokens), a),
        encode_image=encode_image,
        unknown_words=unknown_words,
    )


def to_arrays(model: Model, *, dtype: Any = np.float16) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """(arrays, metadata) as a file of weights holds them."""
    leaves, _ = jax.tree.flatten_with_path(model.params)
    arrays = {jax.tree_util.keystr(path, simple=True, separator="."): np.asarray(leaf, dtype) for path, leaf in leaves}
    metadata = {"format": FORMAT, "architecture": json.dumps(asdict(model.architecture)), "vocabulary": " ".join(model.vocabulary)}
    return arrays, metadata


def from_arrays(name: str, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, str], digest: str) -> Encoder:
    """The encoder that a file of weights holds.

    Raises:
      ValueError: not a file of this format, or an array is missing or has another shape; its text is one sentence.
    """
    return encoder(name, model_from_arrays(name, arrays, metadata), digest)


def model_from_arrays(name: str, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> Model:
    """The inverse of `to_arrays`, in float32. Raises as `from_arrays`."""
    if metadata.get("format") != FORMAT:
        raise ValueError(f"expected weights of format {FORMAT!r} for {name!r}, got {metadata.get('format')!r}: train or fetch them again")
    architecture = Architecture(**json.loads(metadata["architecture"]))
    shapes = jax.eval_shape(lambda: init(jax.random.key(0), architecture))

    def leaf(path: tuple[Any, ...], shape: jax.ShapeDtypeStruct) -> Array:
        key = jax.tree_util.keystr(path, simple=True, separator=".")
        if key not in arrays or arrays[key].shape != shape.shape:
            got = arrays[key].shape if key in arrays else "nothing"
            raise ValueError(
                f"expected array {key!r} of shape {shape.shape} in the weights of {name!r}, got {got}: the file is damaged, fetch it again"
            )
        return jnp.asarray(arrays[key], jnp.float32)

    return Model(architecture, tuple(metadata["vocabulary"].split()), jax.tree_util.tree_map_with_path(leaf, shapes))

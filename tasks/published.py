"""Published image-text models by name: found or fetched, verified, loaded, as an `Encoder`.

A name is a short one of the registry, a folder, or owner/name on the hub.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from os.path import isdir
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dreamfields_core.guidance import lit, registry
from dreamfields_core.guidance.architecture import Activation, Architecture, UnfitModel
from dreamfields_core.guidance.families import read_architecture
from dreamfields_core.guidance.vocabulary import is_second, read_tokenizer
from storage import published as shelf
from storage.digests import json_digest
from storage.download import fetch
from storage.errors import MissingWeights
from storage.mapped import map_arrays
from storage.published import ModelFiles, NotPublished

if TYPE_CHECKING:  # importing it starts JAX, and a card must be cheap
    from dreamfields_core.types import Encoder

BOTH = ("image", "text")
VERSION = 2
"""Raised when the same files would give other embeddings: part of every digest."""

HUB, OPEN_CLIP = ("config.json", "model.safetensors"), ("open_clip_config.json", "open_clip_model.safetensors")
SHARDED = ("config.json", "model.safetensors.index.json")
TOKENIZERS = (("tokenizer.json",), ("vocab.json", "merges.txt"), ("spiece.model",))


@dataclass(frozen=True)
class Found:
    """A model's files and what they decide: weights to open, the architecture, and the files of its tokenizer."""

    name: str
    arch: Architecture
    files: ModelFiles
    weights: tuple[str, ...]
    words: ModelFiles
    vocabulary: tuple[str, ...]

    def digest(self, *, eight_bits: bool = False) -> str:
        """Over all that decides an embedding: weights, tokenizer, architecture, rounding, and this code's version. JAX is not started."""
        return json_digest([VERSION, eight_bits, self.files.digest(self.weights), self.words.digest(self.vocabulary), asdict(self.arch)])


def is_published(name: str) -> bool:
    """Whether the name can only mean a published model: a short name of the registry, a folder, or owner/name."""
    return name in registry.NAMES or "/" in name or isdir(name)


def load_published(name: str, *, towers: Collection[str] = BOTH, eight_bits: bool = False) -> Encoder:
    """The model as an `Encoder`, downloaded once.

    Args:
      name: short name, folder, or owner/name on the hub.
      towers: "image", "text" or both: a tower that is not needed is not read into memory.
      eight_bits: round resized pictures as the published preprocessing does: for a judge, not for guidance.

    Raises: UnfitModel, and StorageErrors (NoNetwork, Offline, NotPublished, MissingWeights, UnreadableWeights): one sentence each.
    """
    from dreamfields_core.guidance.published import encoder, read_weights

    found = find_published(name)
    params = read_weights(map_arrays([found.files.paths[part] for part in found.weights]), found.arch, towers=towers)
    tokenize = read_tokenizer(_bytes(found.words, found.vocabulary), found.arch, name=found.name)
    return encoder(found.name, found.digest(eight_bits=eight_bits), found.arch, params, tokenize, eight_bits=eight_bits)


def find_published(name: str) -> Found:
    """The files and architecture of a model, fetched if need be, its weights not yet read. Raises: as `load_published`."""
    entry = registry.NAMES.get(name) if isdir(name) else registry.known(name)
    if entry is not None and entry.family == "lit":
        return _lit(entry.name, _fetched_lit(entry))
    if entry is not None:
        files = shelf.from_hub(entry.repository, _order(entry), revision=entry.revision, sha256=entry.sha256)
        return _hub(name, files, entry.repository, tokenizer=entry.tokenizer, activation=entry.activation)
    if isdir(name):
        return _folder(Path(name))
    if "/" in name:
        files = shelf.from_hub(name, (HUB[:1], OPEN_CLIP[:1]))
        plain = "config.json" in files.paths and _settings(files, "config.json").get("model_type")
        files = shelf.from_hub(name, (HUB, SHARDED) if plain else (OPEN_CLIP,))
        return _hub(name, files, name)
    raise NotPublished(f'Expected a published model, a folder or owner/name, got "{name}": `dreamfields models` lists the names.')


def describe_models() -> list[dict[str, Any]]:
    """A row per short name for `dreamfields models`: name, about, image_size, megabytes, licence, on_disk, from."""
    rows = []
    for model in registry.MODELS:
        there = _on_disk(model)
        rows.append(
            {
                "name": model.name,
                "about": model.about,
                "image_size": model.image_size,
                "megabytes": round(shelf.size_on_disk(there) / 1e6) if there else model.megabytes,
                "licence": model.licence,
                "on_disk": bool(there),
                "from": model.address or model.repository,
            }
        )
    return rows


def _order(model: registry.Published) -> tuple[tuple[str, str], ...]:
    return (HUB, OPEN_CLIP, SHARDED) if model.layout == "hub" else (OPEN_CLIP, HUB, SHARDED)


def _on_disk(model: registry.Published) -> list[Path]:
    """All files that the model needs, where every one of them is there; else none."""
    if model.address and model.vocabulary:
        paths = [_lit_folder() / address.rsplit("/", 1)[-1] for address in (model.address, model.vocabulary)]
        return paths if all(path.is_file() for path in paths) else []
    files = shelf.on_disk(model.repository, _order(model)[:2], revision=model.revision)
    words = shelf.on_disk(model.tokenizer or model.repository, TOKENIZERS)
    return [*files.values(), *words.values()] if files and words else []


def _folder(folder: Path) -> Found:
    files = shelf.from_folder(folder)
    if any(path.suffix == ".npz" for path in files.paths.values()):
        return _lit(folder.resolve().name, files)
    for config, weights in (HUB, SHARDED, OPEN_CLIP):
        if config in files.paths and weights in files.paths:
            return _hub(folder.resolve().name, files, None, config=config, weights=weights)
    pickles = [name for name in files.paths if name.endswith((".bin", ".pt", ".pth"))]
    if pickles and not any(name.endswith(".safetensors") for name in files.paths):
        map_arrays([files.paths[pickles[0]]])
    raise MissingWeights(
        f"Expected config.json with model.safetensors, open_clip_config.json with open_clip_model.safetensors, or a LiT npz in {folder}, "
        f"got {', '.join(list(files.paths)[:5])}: add what is missing."
    )


def _hub(
    name: str,
    files: ModelFiles,
    repository: str | None,
    *,
    tokenizer: str | None = None,
    activation: Activation | None = None,
    config: str | None = None,
    weights: str | None = None,
) -> Found:
    """A model in the hub's form or open_clip's; without a repository, all of it lies in one folder."""
    config = config or next(iter(files.paths))
    weights = weights or list(files.paths)[1]
    settings = _settings(files, config)
    parts = (weights,)
    if weights.endswith(".index.json"):
        parts = tuple(sorted(set(_settings(files, weights).get("weight_map", {}).values())))
        if repository:
            files = ModelFiles(files.origin, files.paths | shelf.from_hub(repository, (parts,)).paths)
        elif missing := [part for part in parts if part not in files.paths]:
            raise MissingWeights(f"Expected {missing[0]} beside {weights} in {files.origin}, found none: add it.")
    words, vocabulary = _words(files, tokenizer or repository)
    arch = read_architecture(settings, second=is_second(_bytes(words, vocabulary)))
    if activation is not None:
        image, text = arch.image, arch.text
        arch = replace(
            arch,
            image=replace(image, stack=replace(image.stack, activation=activation)),
            text=replace(text, stack=replace(text.stack, activation=activation)),
        )
    return Found(name, arch, files, parts, words, vocabulary)


def _words(files: ModelFiles, repository: str | None) -> tuple[ModelFiles, tuple[str, ...]]:
    if repository is not None:
        words = shelf.from_hub(repository, TOKENIZERS)
        return words, tuple(words.paths)
    for layout in TOKENIZERS:
        if all(name in files.paths for name in layout):
            return files, layout
    raise MissingWeights(f"Expected tokenizer.json, or vocab.json and merges.txt, or spiece.model in {files.origin}, found none: add one.")


def _settings(files: ModelFiles, name: str) -> dict[str, Any]:
    try:
        settings = json.loads(files.text(name))
    except json.JSONDecodeError as problem:
        raise UnfitModel(f"expected JSON in {files.paths[name]}, got text that is none ({problem}): fetch it again") from None
    if not isinstance(settings, dict):
        raise UnfitModel(f"expected a JSON object in {files.paths[name]}, got a {type(settings).__name__}: fetch it again")
    return settings


def _bytes(files: ModelFiles, names: Collection[str]) -> dict[str, bytes]:
    return {name: files.paths[name].read_bytes() for name in names}


def _lit_folder() -> Path:
    return shelf.cache_folder().parent / "dreamfields-lit"


def _fetched_lit(entry: registry.Published) -> ModelFiles:
    assert entry.address and entry.vocabulary
    paths = [fetch(address, _lit_folder(), sha256=entry.sha256.get(address)) for address in (entry.address, entry.vocabulary)]
    return ModelFiles(entry.address, {path.name: path for path in paths})


def _lit(name: str, files: ModelFiles) -> Found:
    weights = next(file for file in files.paths if file.endswith(".npz"))
    stem = weights.removesuffix(".npz")
    places = (f"{stem}.txt", "vocab.txt", f"{stem}.model", "spiece.model")
    vocabulary = next((file for file in places if file in files.paths), None)
    if vocabulary is None:
        raise MissingWeights(f"Expected {stem}.txt or {stem}.model beside {weights} in {files.origin}, found neither: add it.")
    return Found(name, lit.from_shapes(map_arrays([files.paths[weights]]).shapes), files, (weights,), files, (vocabulary,))

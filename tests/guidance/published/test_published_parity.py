"""Embeddings and image gradients against the trusted implementation, from files that it wrote itself.

Within 1e-4 relative for embeddings, 1e-3 for gradients, in float32. The small models are rough in every parameter, so that a part
left out or in the wrong place shows.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

torch = pytest.importorskip("torch")
transformers = pytest.importorskip("transformers")

import published_lit as lits  # noqa: E402
import published_models as made  # noqa: E402
from plain_siglip import as_open_clip  # noqa: E402
from safetensors.numpy import save_file  # noqa: E402

from dreamfields_core.guidance.families import read_architecture  # noqa: E402
from dreamfields_core.guidance.lit import from_shapes  # noqa: E402
from dreamfields_core.guidance.published import encoder, match_probability, read_weights  # noqa: E402
from dreamfields_core.types import Encoder  # noqa: E402
from storage.mapped import map_arrays  # noqa: E402

EMBEDDING, GRADIENT = 1e-4, 1e-3
Reference = Callable[[Any, Any], tuple[Any, Any]]
"""(pictures [B, H, W, 3] normalised, tokens) -> embeddings of both, any length."""


def load(path: Path, config: dict[str, Any] | None, **options: Any) -> Encoder:
    """An encoder from a weights file that the reference wrote; its tokenizer plays no part here."""
    arrays = map_arrays([path])
    arch = read_architecture(config) if config else from_shapes(arrays.shapes)
    return encoder("tested", "", arch, read_weights(arrays, arch, **options), lambda captions: np.zeros((len(captions), 1), np.int32))


def hub_case(tmp_path: Path, model: Any) -> tuple[Encoder, Reference]:
    """CLIP or SigLIP, written by the hub's own library."""
    made.roughen(model).save_pretrained(tmp_path)

    def reference(pictures: Any, tokens: Any) -> tuple[Any, Any]:
        out = model(pixel_values=pictures.permute(0, 3, 1, 2), input_ids=tokens)
        return out.image_embeds, out.text_embeds

    return load(tmp_path / "model.safetensors", json.loads((tmp_path / "config.json").read_text())), reference


def open_clip_case(tmp_path: Path, model: Any) -> tuple[Encoder, Reference]:
    """The same CLIP under open_clip's names."""
    _, reference = hub_case(tmp_path, model)
    save_file(made.open_clip_arrays(model.state_dict()), tmp_path / "open_clip_model.safetensors")
    return load(tmp_path / "open_clip_model.safetensors", made.open_clip_config(model.config)), reference


def siglip_as_open_clip_case(tmp_path: Path, model: Any) -> tuple[Encoder, Reference]:
    """The same SigLIP under open_clip's names; timm's table of sizes has none so small, so its numbers are the hub's."""
    ours, reference = hub_case(tmp_path, model)
    arch = replace(read_architecture(json.loads((tmp_path / "config.json").read_text())), layout="open_clip")
    save_file(as_open_clip({name: value.numpy() for name, value in model.state_dict().items()}), tmp_path / "open_clip.safetensors")
    return encoder("tested", "", arch, read_weights(map_arrays([tmp_path / "open_clip.safetensors"]), arch), ours.tokenize), reference


def lit_case(tmp_path: Path, image: Any, text: Any, *, old_names: bool = False, dim: int | None = 24) -> tuple[Encoder, Reference]:
    """A LiT put together from the library's ViT and its BERT or SigLIP text tower, under the published names."""
    arrays, reference = lits.lit_arrays(made.roughen(image, 1), made.roughen(text, 2), old_names=old_names, dim=dim)
    np.savez(tmp_path / "LiT.npz", **arrays)
    return load(tmp_path / "LiT.npz", None), reference


CASES: dict[str, Callable[[Path], tuple[Encoder, Reference]]] = {
    "clip, QuickGELU": lambda path: hub_case(path, transformers.CLIPModel(made.clip_config())),
    "clip, GELU, 3 heads, odd grid": lambda path: hub_case(path, transformers.CLIPModel(made.clip_config(quick=False, size=42, patch=14))),
    "clip as open_clip, QuickGELU": lambda path: open_clip_case(path, transformers.CLIPModel(made.clip_config())),
    "clip as open_clip, GELU": lambda path: open_clip_case(path, transformers.CLIPModel(made.clip_config(quick=False))),
    "siglip": lambda path: hub_case(path, transformers.SiglipModel(made.siglip_config())),
    "siglip as open_clip": lambda path: siglip_as_open_clip_case(path, transformers.SiglipModel(made.siglip_config())),
    "lit with BERT": lambda path: lit_case(path, lits.vit(), lits.bert()),
    "lit with BERT, no image head, old names": lambda path: lit_case(path, lits.vit(), lits.bert(), old_names=True, dim=None),
    "lit with a plain text tower": lambda path: lit_case(path, lits.vit(), lits.plain_text()),
}


def pictures(model: Encoder, count: int = 3) -> np.ndarray:
    return np.random.default_rng(0).random((count, model.image_size, model.image_size, 3), np.float32)


def captions(model: Encoder, count: int = 3) -> np.ndarray:
    """Tokens that end where CLIP's, SigLIP's and BERT's do, padded with zeros."""
    words, length = model.params["text"]["words"].shape[0], min(model.params["text"]["positions"].shape[0], 77)
    rng = np.random.default_rng(1)
    tokens = rng.integers(1, words - 1, (count, length))
    for row, end in enumerate(rng.integers(2, length, count)):
        tokens[row, end] = words - 1
        tokens[row, end + 1 :] = 0
    return tokens


def normalised(model: Encoder, images: Any) -> Any:
    """The reference's pictures are normalised by the reference's numbers, not by ours."""
    clip = "project" in model.params["image"] and "bias" not in model.params["image"]["project"] and "class_token" in model.params["image"]
    mean = torch.tensor([0.48145466, 0.4578275, 0.40821073] if clip else [0.5] * 3)
    std = torch.tensor([0.26862954, 0.26130258, 0.27577711] if clip else [0.5] * 3)
    return (images - mean) / std


def unit(vectors: Any) -> Any:
    return vectors / vectors.norm(dim=-1, keepdim=True)


def relative(ours: Any, theirs: Any) -> float:
    """Largest difference of any vector, relative to that vector's length."""
    ours, theirs = np.asarray(ours).reshape(len(ours), -1), np.asarray(theirs).reshape(len(theirs), -1)
    return float(np.max(np.linalg.norm(ours - theirs, axis=1) / np.linalg.norm(theirs, axis=1)))


def compare(model: Encoder, reference: Reference, count: int = 3) -> dict[str, float]:
    """Errors of embeddings, the gradient of their cosine in the image, and all of it under jit."""
    images, tokens = pictures(model, count), captions(model, count)
    given = torch.tensor(images, requires_grad=True)
    image, text = (unit(part) for part in reference(normalised(model, given), torch.tensor(tokens)))
    (image * text.detach()).sum().backward()

    def agreement(params: Any, images: Any, tokens: Any) -> Any:
        seen, said = model.encode_image(params, images), model.encode_text(params, tokens)
        return jnp.sum(seen * text.detach().numpy()), (seen, said)

    run = jax.jit(jax.grad(agreement, argnums=1, has_aux=True))
    gradient, (seen, said) = run(model.params, images, tokens)
    return {
        "image": relative(seen, image.detach()),
        "text": relative(said, text.detach()),
        "gradient": relative(gradient, given.grad),
    }


@pytest.mark.parametrize("case", CASES)
def test_embeddings_and_gradients_agree(case: str, tmp_path: Path) -> None:
    model, reference = CASES[case](tmp_path)
    errors = compare(model, reference)
    print(case, errors)
    assert max(errors["image"], errors["text"]) < EMBEDDING and errors["gradient"] < GRADIENT, errors


def test_the_same_one_by_one_under_vmap(tmp_path: Path) -> None:
    model, _ = CASES["siglip"](tmp_path)
    images, tokens = pictures(model), captions(model)
    alone = jax.jit(jax.vmap(lambda image: model.encode_image(model.params, image[None])[0]))(images)
    assert relative(alone, jax.jit(model.encode_image)(model.params, images)) < 1e-5
    alone = jax.jit(jax.vmap(lambda row: model.encode_text(model.params, row[None])[0]))(tokens)
    assert relative(alone, jax.jit(model.encode_text)(model.params, tokens)) < 1e-5


@pytest.mark.parametrize("half", ["float16", "bfloat16"])
def test_half_precision_files_stay_half_in_memory(half: str, tmp_path: Path) -> None:
    model = made.roughen(transformers.SiglipModel(made.siglip_config())).to(getattr(torch, half))
    model.save_pretrained(tmp_path)
    ours = load(tmp_path / "model.safetensors", json.loads((tmp_path / "config.json").read_text()))
    assert {leaf.dtype.name for leaf in jax.tree.leaves(ours.params)} == {half}
    model = model.float()

    def reference(pictures: Any, tokens: Any) -> tuple[Any, Any]:
        out = model(pixel_values=pictures.permute(0, 3, 1, 2), input_ids=tokens)
        return out.image_embeds, out.text_embeds

    errors = compare(ours, reference)
    assert max(errors["image"], errors["text"]) < EMBEDDING and errors["gradient"] < GRADIENT, errors


def test_siglip_scores_pairs_as_published(tmp_path: Path) -> None:
    torch_model = transformers.SiglipModel(made.siglip_config())
    model, _ = hub_case(tmp_path, torch_model)
    images, tokens = pictures(model), captions(model)
    cosines = model.encode_image(model.params, images) @ model.encode_text(model.params, tokens).T
    out = torch_model(pixel_values=normalised(model, torch.tensor(images)).permute(0, 3, 1, 2), input_ids=torch.tensor(tokens))
    np.testing.assert_allclose(match_probability(model.params, cosines), torch.sigmoid(out.logits_per_image), atol=1e-5)


def test_only_the_wanted_tower_is_read(tmp_path: Path) -> None:
    made.roughen(transformers.CLIPModel(made.clip_config())).save_pretrained(tmp_path)
    model = load(tmp_path / "model.safetensors", json.loads((tmp_path / "config.json").read_text()), towers=("image",))
    assert set(model.params) == {"image", "scoring"}
    with pytest.raises(ValueError, match="with its text tower, got it loaded without"):
        model.encode_text(model.params, np.zeros((1, 4), np.int32))


FULL: dict[str, Callable[[Path], tuple[Encoder, Reference]]] = {
    "CLIP B/32": lambda path: hub_case(path, made.full_clip("B", 32)),
    "CLIP B/32 as open_clip, GELU": lambda path: open_clip_case(path, made.full_clip("B", 32, activation="gelu")),
    "CLIP B/16 as open_clip": lambda path: open_clip_case(path, made.full_clip("B", 16)),
    "CLIP L/14": lambda path: hub_case(path, made.full_clip("L", 14)),
    "CLIP L/14 at 336 pixels as open_clip": lambda path: open_clip_case(path, made.full_clip("L", 14, size=336)),
    "SigLIP B/16": lambda path: hub_case(path, transformers.SiglipModel(transformers.SiglipConfig())),
    "SigLIP 2 B/16 at 256 pixels": lambda path: hub_case(path, made.full_siglip2()),
    "LiT B/16 with BERT-base": lambda path: lit_case(path, lits.vit(full=True), lits.bert(full=True), dim=768),
}


@pytest.mark.parity
@pytest.mark.parametrize("case", FULL)
def test_full_size(case: str, tmp_path: Path) -> None:
    """Models of 150 to 430 million parameters, written by the reference; 7.4 GB of memory at the most."""
    model, reference = FULL[case](tmp_path)
    errors = compare(model, reference, count=2)
    print(case, errors)
    assert max(errors["image"], errors["text"]) < EMBEDDING and errors["gradient"] < GRADIENT, errors

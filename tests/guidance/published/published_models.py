"""Small models, written to disk by the trusted implementation, and their tokenizers made on the spot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from tokenizers import Tokenizer, models, pre_tokenizers, trainers

SENTENCES = [
    "a photo of a red cube",
    "an orange bike leaning on a pole in the snow",
    "a stack of pancakes with syrup on a plate",
    "the quick brown fox jumps over the lazy dog",
    "two zebras drink at a water hole",
    "a bust of a woman made of marble, high quality",
] * 4


def clip_vocabulary() -> tuple[dict[str, int], list[tuple[str, str]]]:
    """A byte-level vocabulary in CLIP's order: bytes, bytes that end a word, merges, start, end."""
    letters = sorted(pre_tokenizers.ByteLevel.alphabet())
    tokenizer = Tokenizer(models.BPE(end_of_word_suffix="</w>"))
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence(
        [pre_tokenizers.Whitespace(), pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False)]
    )
    trainer = trainers.BpeTrainer(vocab_size=700, end_of_word_suffix="</w>", show_progress=False)
    tokenizer.train_from_iterator(SENTENCES, trainer)
    merges = [tuple(merge) for merge in json.loads(tokenizer.to_str())["model"]["merges"]]
    words = [*letters, *(f"{letter}</w>" for letter in letters), *("".join(merge) for merge in merges), "<|startoftext|>", "<|endoftext|>"]
    return {word: place for place, word in enumerate(dict.fromkeys(words))}, merges


def clip_config(*, quick: bool = True, size: int = 32, patch: int = 8, width: int = 64, layers: int = 2, **text: Any) -> Any:
    """A small CLIP; `text` overrides the text tower's numbers."""
    import transformers

    activation = "quick_gelu" if quick else "gelu"
    shape = {"num_hidden_layers": layers, "hidden_act": activation}
    return transformers.CLIPConfig(
        vision_config={
            "hidden_size": width,
            "intermediate_size": 2 * width,
            "num_attention_heads": 4,
            "image_size": size,
            "patch_size": patch,
        }
        | shape,
        text_config={"hidden_size": 48, "intermediate_size": 96, "num_attention_heads": 3, "vocab_size": 800, "eos_token_id": 799}
        | shape
        | text,
        projection_dim=40,
    )


def siglip_config(*, size: int = 32, patch: int = 8) -> Any:
    """A small SigLIP, both towers of one width as in all published ones."""
    import transformers

    shape = {"hidden_size": 64, "intermediate_size": 160, "num_attention_heads": 4, "num_hidden_layers": 2}
    return transformers.SiglipConfig(
        vision_config=shape | {"image_size": size, "patch_size": patch},
        text_config=shape | {"vocab_size": 300, "max_position_embeddings": 16},
    )


SIZES = {
    "B": ({"hidden_size": 768, "num_hidden_layers": 12, "num_attention_heads": 12}, {"hidden_size": 512, "num_attention_heads": 8}, 512),
    "L": ({"hidden_size": 1024, "num_hidden_layers": 24, "num_attention_heads": 16}, {"hidden_size": 768, "num_attention_heads": 12}, 768),
}
"""CLIP's published sizes: the image tower, the text tower, the length of an embedding. MLPs are four times as wide in the middle."""


def full_clip(letter: str, patch: int, *, size: int = 224, activation: str = "quick_gelu") -> Any:
    """A CLIP of a published size."""
    import transformers

    image, text, dim = SIZES[letter]
    towers = [part | {"intermediate_size": 4 * part["hidden_size"], "hidden_act": activation} for part in (image, text)]
    return transformers.CLIPModel(
        transformers.CLIPConfig(
            vision_config=towers[0] | {"image_size": size, "patch_size": patch}, text_config=towers[1], projection_dim=dim
        )
    )


def full_siglip2() -> Any:
    """SigLIP 2 B/16 at 256 pixels: SigLIP's towers with a vocabulary of 256 000 tokens."""
    import transformers

    return transformers.SiglipModel(
        transformers.SiglipConfig(
            vision_config={"image_size": 256, "patch_size": 16}, text_config={"vocab_size": 256_000, "max_position_embeddings": 64}
        )
    )


def roughen(model: Any, seed: int = 0) -> Any:
    """Every parameter random, biases, normalisations, positions and pooling too: a part that is left out shows."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, value in model.named_parameters():
            noise = torch.randn(value.shape, generator=generator)
            if value.ndim >= 2:
                value.copy_(noise * 1.5 / value[0].numel() ** 0.5)
            elif "norm" in name.lower() and name.endswith("weight"):
                value.copy_(1 + 0.2 * noise)
            elif name.startswith("logit"):
                value.copy_(0.3 * noise + 1)
            else:
                value.copy_(0.2 * noise)
    return model.eval().requires_grad_(False)


def open_clip_arrays(state: dict[str, Any]) -> dict[str, np.ndarray]:
    """The arrays of the hub's CLIP under the names that open_clip writes, three parts of an attention in one."""
    arrays = {name: np.asarray(value) for name, value in state.items()}
    towers = {"vision_model": ("visual.transformer.resblocks", "visual"), "text_model": ("transformer.resblocks", "")}
    out = {
        "visual.class_embedding": arrays["vision_model.embeddings.class_embedding"],
        "visual.conv1.weight": arrays["vision_model.embeddings.patch_embedding.weight"],
        "visual.positional_embedding": arrays["vision_model.embeddings.position_embedding.weight"],
        "visual.proj": arrays["visual_projection.weight"].T,
        "token_embedding.weight": arrays["text_model.embeddings.token_embedding.weight"],
        "positional_embedding": arrays["text_model.embeddings.position_embedding.weight"],
        "text_projection": arrays["text_projection.weight"].T,
        "logit_scale": arrays["logit_scale"],
    }
    norms = {
        "visual.ln_pre": "vision_model.pre_layrnorm",
        "visual.ln_post": "vision_model.post_layernorm",
        "ln_final": "text_model.final_layer_norm",
    }
    for kind in ("weight", "bias"):
        out |= {f"{ours}.{kind}": arrays[f"{theirs}.{kind}"] for ours, theirs in norms.items()}
        for tower, (blocks, _) in towers.items():
            count = len({name.split(".")[3] for name in arrays if name.startswith(f"{tower}.encoder.layers.")})
            for place in range(count):
                block, theirs = f"{blocks}.{place}", f"{tower}.encoder.layers.{place}"
                out[f"{block}.attn.in_proj_{kind}"] = np.concatenate([arrays[f"{theirs}.self_attn.{part}_proj.{kind}"] for part in "qkv"])
                parts = {
                    "attn.out_proj": "self_attn.out_proj",
                    "ln_1": "layer_norm1",
                    "ln_2": "layer_norm2",
                    "mlp.c_fc": "mlp.fc1",
                    "mlp.c_proj": "mlp.fc2",
                }
                out |= {f"{block}.{ours}.{kind}": arrays[f"{theirs}.{other}.{kind}"] for ours, other in parts.items()}
    return {name: np.ascontiguousarray(value) for name, value in out.items()}


def open_clip_config(config: Any) -> dict[str, Any]:
    """What open_clip writes beside its weights, for the same architecture."""
    image, text = config.vision_config, config.text_config
    return {
        "model_cfg": {
            "embed_dim": config.projection_dim,
            "quick_gelu": image.hidden_act == "quick_gelu",
            "vision_cfg": {
                "image_size": image.image_size,
                "layers": image.num_hidden_layers,
                "width": image.hidden_size,
                "patch_size": image.patch_size,
                "head_width": image.hidden_size // image.num_attention_heads,
                "mlp_ratio": image.intermediate_size / image.hidden_size,
            },
            "text_cfg": {
                "context_length": text.max_position_embeddings,
                "vocab_size": text.vocab_size,
                "width": text.hidden_size,
                "heads": text.num_attention_heads,
                "layers": text.num_hidden_layers,
                "mlp_ratio": text.intermediate_size / text.hidden_size,
            },
        },
        "preprocess_cfg": {"mean": [0.48145466, 0.4578275, 0.40821073], "std": [0.26862954, 0.26130258, 0.27577711]},
    }


def write_folder(folder: Path, model: Any, vocabulary: dict[str, int] | None = None, merges: list[tuple[str, str]] | None = None) -> Path:
    """A folder as the hub has it, written by the trusted implementation itself."""
    model.save_pretrained(folder)
    if vocabulary is not None and merges is not None:
        write_clip_tokenizer(folder, vocabulary, merges)
    return folder


def write_clip_tokenizer(folder: Path, vocabulary: dict[str, int], merges: list[tuple[str, str]]) -> None:
    """`vocab.json` and `merges.txt`."""
    (folder / "vocab.json").write_text(json.dumps(vocabulary), encoding="utf-8")
    (folder / "merges.txt").write_text("#version: 0.2\n" + "\n".join(" ".join(merge) for merge in merges) + "\n", encoding="utf-8")


def gemma_vocabulary() -> tuple[dict[str, int], list[tuple[str, str]]]:
    """A byte-pair vocabulary in Gemma's form: special tokens, all bytes, letters, merges; spaces are letters too."""
    tokenizer = Tokenizer(models.BPE())
    trainer = trainers.BpeTrainer(vocab_size=300, show_progress=False)
    tokenizer.train_from_iterator([text.replace(" ", "▁") for text in SENTENCES], trainer)
    model = json.loads(tokenizer.to_str())["model"]
    special = ["<pad>", "<eos>", "<bos>", "<unk>", "<mask>", *(f"<0x{byte:02X}>" for byte in range(256))]
    words = [*special, *sorted(model["vocab"], key=model["vocab"].get)]
    return {word: place for place, word in enumerate(dict.fromkeys(words))}, [tuple(merge) for merge in model["merges"]]

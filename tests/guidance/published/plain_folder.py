"""A small CLIP in the hub's form, of random weights, written without the trusted implementation: for tests of files, not of numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import published_models as made
from safetensors.numpy import save_file

CONFIG: dict[str, Any] = {
    "model_type": "clip",
    "projection_dim": 24,
    "vision_config": {
        "hidden_size": 32, "num_hidden_layers": 2, "num_attention_heads": 2, "intermediate_size": 64, "image_size": 32, "patch_size": 16,
    },
    "text_config": {"hidden_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2, "intermediate_size": 32},
}  # fmt: skip


def config(**changes: Any) -> dict[str, Any]:
    """The configuration, its vocabulary the size of the one that `published_models` makes."""
    text = CONFIG["text_config"] | {"vocab_size": len(made.clip_vocabulary()[0])}
    return json.loads(json.dumps(CONFIG | {"text_config": text} | changes))


def shapes(settings: dict[str, Any]) -> dict[str, tuple[int, ...]]:
    """The shape of every array under the hub's names."""
    image, text, dim = settings["vision_config"], settings["text_config"], settings["projection_dim"]
    shapes: dict[str, tuple[int, ...]] = {
        "logit_scale": (),
        "visual_projection.weight": (dim, image["hidden_size"]),
        "text_projection.weight": (dim, text["hidden_size"]),
        "vision_model.embeddings.class_embedding": (image["hidden_size"],),
        "vision_model.embeddings.patch_embedding.weight": (image["hidden_size"], 3, image["patch_size"], image["patch_size"]),
        "vision_model.embeddings.position_embedding.weight": ((image["image_size"] // image["patch_size"]) ** 2 + 1, image["hidden_size"]),
        "text_model.embeddings.token_embedding.weight": (text["vocab_size"], text["hidden_size"]),
        "text_model.embeddings.position_embedding.weight": (77, text["hidden_size"]),
    }
    norms = {"vision_model.pre_layrnorm": image, "vision_model.post_layernorm": image, "text_model.final_layer_norm": text}
    for tower, part in (("vision_model", image), ("text_model", text)):
        for place in range(part["num_hidden_layers"]):
            block, width, hidden = f"{tower}.encoder.layers.{place}", part["hidden_size"], part["intermediate_size"]
            norms |= {f"{block}.layer_norm1": part, f"{block}.layer_norm2": part}
            dense = {f"self_attn.{name}_proj": (width, width) for name in ("q", "k", "v", "out")}
            for name, shape in (dense | {"mlp.fc1": (hidden, width), "mlp.fc2": (width, hidden)}).items():
                shapes |= {f"{block}.{name}.weight": shape, f"{block}.{name}.bias": shape[:1]}
    return shapes | {f"{name}.{kind}": (part["hidden_size"],) for name, part in norms.items() for kind in ("weight", "bias")}


def arrays(settings: dict[str, Any], *, scale: float = 0.2) -> dict[str, np.ndarray]:
    """Random weights under the hub's names."""
    rng = np.random.default_rng(0)
    return {name: rng.normal(0, scale, shape).astype(np.float32) for name, shape in shapes(settings).items()}


def write(folder: Path, settings: dict[str, Any] | None = None) -> Path:
    """config.json, model.safetensors, vocab.json and merges.txt."""
    folder.mkdir(parents=True, exist_ok=True)
    settings = settings or config()
    (folder / "config.json").write_text(json.dumps(settings), encoding="utf-8")
    save_file(arrays(settings), folder / "model.safetensors")
    made.write_clip_tokenizer(folder, *made.clip_vocabulary())
    return folder

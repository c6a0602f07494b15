"""A small SigLIP of random weights as plain arrays, under the hub's names and under open_clip's."""

from __future__ import annotations

from typing import Any

import numpy as np

STACK = {"hidden_size": 32, "num_hidden_layers": 2, "num_attention_heads": 2, "intermediate_size": 80}
HUB: dict[str, Any] = {
    "model_type": "siglip",
    "vision_config": STACK | {"image_size": 32, "patch_size": 16},
    "text_config": STACK | {"vocab_size": 50, "max_position_embeddings": 8},
}
OPEN_CLIP: dict[str, Any] = {
    "model_cfg": {
        "embed_dim": 32,
        "custom_text": True,
        "vision_cfg": {"image_size": 32, "timm_model_name": "vit_small_patch16_siglip_32", "timm_pool": "map", "timm_proj": "none"},
        "text_cfg": {"context_length": 8, "vocab_size": 50, "width": 32, "heads": 2, "layers": 2, "mlp_ratio": 2.5},
    },
    "preprocess_cfg": {"mean": [0.5] * 3, "std": [0.5] * 3, "interpolation": "bicubic", "resize_mode": "squash"},
}
SMALL = (32, 2, 2, 80)
"""What "small" shall mean in the name of OPEN_CLIP's image tower; timm has no SigLIP so small."""


def arrays() -> dict[str, np.ndarray]:
    """Random weights under the hub's names."""
    seen, said, head = "vision_model.embeddings", "text_model.embeddings", "vision_model.head"
    shapes: dict[str, tuple[int, ...]] = {
        f"{seen}.patch_embedding.weight": (32, 3, 16, 16),
        f"{seen}.patch_embedding.bias": (32,),
        f"{seen}.position_embedding.weight": (4, 32),
        f"{head}.probe": (1, 1, 32),
        f"{head}.attention.in_proj_weight": (96, 32),
        f"{head}.attention.in_proj_bias": (96,),
        f"{said}.token_embedding.weight": (50, 32),
        f"{said}.position_embedding.weight": (8, 32),
        "logit_scale": (1,),
        "logit_bias": (1,),
    }
    norms, dense = ["vision_model.post_layernorm", "text_model.final_layer_norm", f"{head}.layernorm"], {"text_model.head": (32, 32)}
    blocks = [f"{tower}.encoder.layers.{place}" for tower in ("vision_model", "text_model") for place in range(2)]
    dense |= {f"{block}.self_attn.{part}_proj": (32, 32) for block in blocks for part in ("q", "k", "v", "out")}
    for block in (*blocks, head):
        dense |= {f"{block}.mlp.fc1": (80, 32), f"{block}.mlp.fc2": (32, 80)}
    norms += [f"{block}.layer_norm{number}" for block in blocks for number in (1, 2)]
    dense |= {f"{head}.attention.out_proj": (32, 32)}
    shapes |= {f"{name}.weight": shape for name, shape in dense.items()} | {f"{name}.weight": (32,) for name in norms}
    shapes |= {f"{name}.bias": shape[:1] for name, shape in dense.items()} | {f"{name}.bias": (32,) for name in norms}
    rng = np.random.default_rng(0)
    return {name: rng.normal(0, 0.3, shape).astype(np.float32) for name, shape in shapes.items()}


RENAMED = {
    "vision_model.embeddings.patch_embedding": "visual.trunk.patch_embed.proj",
    "vision_model.embeddings.position_embedding.weight": "visual.trunk.pos_embed",
    "vision_model.post_layernorm": "visual.trunk.norm",
    "vision_model.head.probe": "visual.trunk.attn_pool.latent",
    "vision_model.head.attention.out_proj": "visual.trunk.attn_pool.proj",
    "vision_model.head.layernorm": "visual.trunk.attn_pool.norm",
    "vision_model.head.mlp": "visual.trunk.attn_pool.mlp",
    "text_model.embeddings.token_embedding": "text.token_embedding",
    "text_model.embeddings.position_embedding.weight": "text.positional_embedding",
    "text_model.final_layer_norm": "text.ln_final",
    "text_model.head": "text.text_projection",
    "logit": "logit",
}
IN_TRUNK = {"layer_norm1": "norm1", "layer_norm2": "norm2", "self_attn.out_proj": "attn.proj", "mlp": "mlp"}
IN_TEXT = {
    "layer_norm1": "ln_1",
    "layer_norm2": "ln_2",
    "self_attn.out_proj": "attn.out_proj",
    "mlp.fc1": "mlp.c_fc",
    "mlp.fc2": "mlp.c_proj",
}


def as_open_clip(hub: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The same model as open_clip writes it: queries, keys and values of a block in one array, those of the pooling head in two."""
    out = {}
    for name, array in hub.items():
        for old, new in RENAMED.items():
            if name == old or name.startswith((f"{old}.", f"{old}_")):
                out[new + name[len(old) :]] = array
    for tower, root, inner in (("vision_model", "visual.trunk.blocks", IN_TRUNK), ("text_model", "text.transformer.resblocks", IN_TEXT)):
        for place in sorted({int(name.split(".")[3]) for name in hub if name.startswith(f"{tower}.encoder")}):
            block = f"{tower}.encoder.layers.{place}."
            for name, array in hub.items():
                for old, new in inner.items():
                    if name.startswith(f"{block}{old}."):
                        out[f"{root}.{place}.{new}{name[len(block + old) :]}"] = array
            for kind in ("weight", "bias"):
                joined = np.concatenate([hub[f"{block}self_attn.{part}_proj.{kind}"] for part in "qkv"])
                out[f"{root}.{place}.attn.{'qkv.' if tower == 'vision_model' else 'in_proj_'}{kind}"] = joined
    for kind in ("weight", "bias"):
        mix = hub[f"vision_model.head.attention.in_proj_{kind}"]
        out[f"visual.trunk.attn_pool.q.{kind}"], out[f"visual.trunk.attn_pool.kv.{kind}"] = mix[: len(mix) // 3], mix[len(mix) // 3 :]
    out["visual.trunk.pos_embed"] = out["visual.trunk.pos_embed"][None]
    return {name: np.ascontiguousarray(array) for name, array in out.items()}

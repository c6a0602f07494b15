"""CLIP (Radford 2021): configuration and names, as the hub's files and open_clip's files write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dreamfields_core.guidance.architecture import Architecture, ImageTower, Pixels, Stack, TextTower, UnfitModel
from dreamfields_core.guidance.tables import Source, Table, dense, joined, norm, same, transposed

MEAN = (0.48145466, 0.4578275, 0.40821073)
STD = (0.26862954, 0.26130258, 0.27577711)
ACTIVATIONS = {"quick_gelu": "quick_gelu", "gelu": "gelu", "gelu_new": "gelu_tanh", "gelu_pytorch_tanh": "gelu_tanh"}

HUB_IMAGE = {"hidden_size": 768, "num_hidden_layers": 12, "num_attention_heads": 12, "intermediate_size": 3072}
HUB_TEXT = {"hidden_size": 512, "num_hidden_layers": 12, "num_attention_heads": 8, "intermediate_size": 2048}
"""What the hub's files leave out when it is the usual."""

FOREIGN = ("timm_model_name", "hf_model_name", "attentional_pool", "ls_init_value", "no_ln_pre")
"""What open_clip's configurations say of models that are no plain CLIP."""


def hub_stack(config: Mapping[str, Any], usual: Mapping[str, int], *, activation: str, epsilon: float) -> Stack:
    """A stack as the hub's `vision_config` and `text_config` write it."""
    known = {**usual, **{key: value for key, value in config.items() if key in usual}}
    named = config.get("hidden_act", activation)
    if named not in ACTIVATIONS:
        raise UnfitModel(f'expected an activation among {", ".join(ACTIVATIONS)}, got "{named}": this model is not supported')
    return Stack(
        width=known["hidden_size"],
        layers=known["num_hidden_layers"],
        heads=known["num_attention_heads"],
        hidden=known["intermediate_size"],
        activation=ACTIVATIONS[named],  # type: ignore[arg-type]
        epsilon=config.get("layer_norm_eps", epsilon),
    )


def from_hub(config: Mapping[str, Any]) -> Architecture:
    """The architecture in a `config.json` whose model_type is "clip"."""
    image, text = config.get("vision_config") or {}, config.get("text_config") or {}
    dim, size = config.get("projection_dim", 512), image.get("image_size", 224)
    return Architecture(
        family="clip",
        image=ImageTower(
            stack=hub_stack(image, HUB_IMAGE, activation="quick_gelu", epsilon=1e-5),
            image_size=size,
            patch=image.get("patch_size", 32),
            enter_norm=True,
            patch_bias=False,
            dim=dim,
        ),
        text=_text(
            hub_stack(text, HUB_TEXT, activation="quick_gelu", epsilon=1e-5),
            text.get("vocab_size", 49408),
            text.get("max_position_embeddings", 77),
            dim,
        ),
        pixels=Pixels(size, MEAN, STD, "bicubic", fit="shortest"),
        layout="hub",
    )


def from_open_clip(config: Mapping[str, Any]) -> Architecture:
    """The architecture in an `open_clip_config.json`; only its plain transformers, not its ResNets or borrowed towers."""
    model, prepare = config.get("model_cfg", config), config.get("preprocess_cfg", {})
    image, text, dim = model.get("vision_cfg", {}), model.get("text_cfg", {}), model.get("embed_dim", 512)
    odd = [key for key in FOREIGN if {**text, **image}.get(key)]
    if odd or not isinstance(image.get("layers"), int):
        raise UnfitModel(
            f"expected open_clip's plain vision transformer, got a model with {odd[0] if odd else 'layers ' + str(image.get('layers'))}: "
            "use the same model in the hub's form (config.json and model.safetensors)"
        )
    activation = "quick_gelu" if model.get("quick_gelu") else "gelu"
    width, size = image.get("width", 768), image.get("image_size", 224)
    hidden = int(width * image.get("mlp_ratio", 4.0))
    return Architecture(
        family="clip",
        image=ImageTower(
            stack=Stack(width, image["layers"], width // image.get("head_width", 64), hidden, activation, 1e-5),  # type: ignore[arg-type]
            image_size=size,
            patch=image.get("patch_size", 16),
            enter_norm=True,
            patch_bias=False,
            dim=dim,
        ),
        text=_text(
            Stack(
                text.get("width", 512),
                text.get("layers", 12),
                text.get("heads", 8),
                int(text.get("width", 512) * text.get("mlp_ratio", 4.0)),
                activation,  # type: ignore[arg-type]
                1e-5,
            ),
            text.get("vocab_size", 49408),
            text.get("context_length", 77),
            dim,
        ),
        pixels=Pixels(
            size,
            tuple(prepare.get("mean", MEAN)),  # type: ignore[arg-type]
            tuple(prepare.get("std", STD)),  # type: ignore[arg-type]
            prepare.get("interpolation", "bicubic"),
            fit="squash" if prepare.get("resize_mode") == "squash" else "shortest",
        ),
        layout="open_clip",
    )


def _text(stack: Stack, vocabulary: int, length: int, dim: int) -> TextTower:
    return TextTower(stack, vocabulary, length, length, causal=True, pool="highest", dim=dim)


def patch_kernel(name: str) -> Source:
    """A convolution's kernel [out, 3, side, side] as [side x side x 3, out], for one product with flat patches."""
    return Source((name,), lambda kernel: kernel.transpose(2, 3, 1, 0).reshape(-1, kernel.shape[0]))


def hub_block(ours: str, theirs: str) -> Table:
    """A block in the names of the hub's CLIP and SigLIP."""
    parts = [f"{theirs}.self_attn.{name}_proj" for name in "qkv"]
    return {
        **norm(f"{ours}/norm1", f"{theirs}.layer_norm1"),
        f"{ours}/attention/mix/kernel": transposed(*(f"{part}.weight" for part in parts)),
        f"{ours}/attention/mix/bias": joined(*(f"{part}.bias" for part in parts)),
        **dense(f"{ours}/attention/out", f"{theirs}.self_attn.out_proj"),
        **norm(f"{ours}/norm2", f"{theirs}.layer_norm2"),
        **dense(f"{ours}/mlp/widen", f"{theirs}.mlp.fc1"),
        **dense(f"{ours}/mlp/narrow", f"{theirs}.mlp.fc2"),
    }


def open_clip_block(ours: str, theirs: str) -> Table:
    """A block in open_clip's names, which are OpenAI's own."""
    return {
        **norm(f"{ours}/norm1", f"{theirs}.ln_1"),
        f"{ours}/attention/mix/kernel": transposed(f"{theirs}.attn.in_proj_weight"),
        f"{ours}/attention/mix/bias": same(f"{theirs}.attn.in_proj_bias"),
        **dense(f"{ours}/attention/out", f"{theirs}.attn.out_proj"),
        **norm(f"{ours}/norm2", f"{theirs}.ln_2"),
        **dense(f"{ours}/mlp/widen", f"{theirs}.mlp.c_fc"),
        **dense(f"{ours}/mlp/narrow", f"{theirs}.mlp.c_proj"),
    }


def hub_tables(arch: Architecture) -> dict[str, Table]:
    """Our names to those of a `model.safetensors` of the hub."""
    seen, said = "vision_model.embeddings", "text_model.embeddings"
    image = {
        "patch/kernel": patch_kernel(f"{seen}.patch_embedding.weight"),
        "class_token": same(f"{seen}.class_embedding"),
        "positions": same(f"{seen}.position_embedding.weight"),
        **norm("enter", "vision_model.pre_layrnorm"),
        **norm("leave", "vision_model.post_layernorm"),
        "project/kernel": transposed("visual_projection.weight"),
    }
    text = {
        "words": same(f"{said}.token_embedding.weight"),
        "positions": same(f"{said}.position_embedding.weight"),
        **norm("leave", "text_model.final_layer_norm"),
        "project/kernel": transposed("text_projection.weight"),
    }
    for place in range(arch.image.stack.layers):
        image |= hub_block(f"blocks/{place}", f"vision_model.encoder.layers.{place}")
    for place in range(arch.text.stack.layers):
        text |= hub_block(f"blocks/{place}", f"text_model.encoder.layers.{place}")
    return {"image": image, "text": text, "scoring": {"scale": same("logit_scale")}}


def open_clip_tables(arch: Architecture) -> dict[str, Table]:
    """Our names to those of an `open_clip_model.safetensors`."""
    image = {
        "patch/kernel": patch_kernel("visual.conv1.weight"),
        "class_token": same("visual.class_embedding"),
        "positions": same("visual.positional_embedding"),
        **norm("enter", "visual.ln_pre"),
        **norm("leave", "visual.ln_post"),
        "project/kernel": same("visual.proj"),
    }
    text = {
        "words": same("token_embedding.weight"),
        "positions": same("positional_embedding"),
        **norm("leave", "ln_final"),
        "project/kernel": same("text_projection"),
    }
    for place in range(arch.image.stack.layers):
        image |= open_clip_block(f"blocks/{place}", f"visual.transformer.resblocks.{place}")
    for place in range(arch.text.stack.layers):
        text |= open_clip_block(f"blocks/{place}", f"transformer.resblocks.{place}")
    return {"image": image, "text": text, "scoring": {"scale": same("logit_scale")}}


def ignored(name: str) -> bool:
    """Constants that older files carry along."""
    return name.endswith("position_ids") or name in ("attn_mask", "input_resolution", "context_length", "vocab_size")

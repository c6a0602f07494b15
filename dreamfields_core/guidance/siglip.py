"""SigLIP (Zhai 2023) and SigLIP 2 (Tschannen 2025) of fixed resolution, as the hub's files write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dreamfields_core.guidance.architecture import Architecture, ImageTower, Pixels, TextTower, UnfitModel
from dreamfields_core.guidance.clip import hub_block, hub_stack, patch_kernel
from dreamfields_core.guidance.tables import Source, Table, dense, norm, same, transposed

HALF = (0.5, 0.5, 0.5)
NAFLEX = "expected a SigLIP 2 of fixed resolution, got a NaFlex model: use for instance siglip2-base-patch16-256"
BASE = {"hidden_size": 768, "num_hidden_layers": 12, "num_attention_heads": 12, "intermediate_size": 3072}


def from_hub(config: Mapping[str, Any], *, second: bool) -> Architecture:
    """The architecture in a `config.json` whose model_type is "siglip"; second: it is a SigLIP 2, resized to bilinearly.

    Raises:
      UnfitModel: a variable-resolution model ("siglip2"), or one without its pooling head.
    """
    image, text = config.get("vision_config") or {}, config.get("text_config") or {}
    if config.get("model_type") == "siglip2" or "num_patches" in image:
        raise UnfitModel(NAFLEX)
    if image.get("vision_use_head") is False:
        raise UnfitModel("expected a SigLIP with its pooling head, got one without: it gives no embedding, use another checkpoint")
    stack = hub_stack(text, BASE, activation="gelu_pytorch_tanh", epsilon=1e-6)
    size, length = image.get("image_size", 224), text.get("max_position_embeddings", 64)
    return Architecture(
        family="siglip",
        image=ImageTower(
            stack=hub_stack(image, BASE, activation="gelu_pytorch_tanh", epsilon=1e-6),
            image_size=size,
            patch=image.get("patch_size", 16),
            class_token=False,
            pool="query",
        ),
        text=TextTower(
            stack,
            vocabulary=text.get("vocab_size", 32000),
            length=length,
            positions=length,
            pool="last",
            dim=text.get("projection_size") or stack.width,
            project_bias=True,
        ),
        pixels=Pixels(size, HALF, HALF, "bilinear" if second else "bicubic"),
        layout="hub",
        sigmoid=True,
    )


def tables(arch: Architecture) -> dict[str, Table]:
    """Our names to those of a `model.safetensors` of the hub."""
    width = arch.image.stack.width
    head = "vision_model.head"
    image = {
        "patch/kernel": patch_kernel("vision_model.embeddings.patch_embedding.weight"),
        "patch/bias": same("vision_model.embeddings.patch_embedding.bias"),
        "positions": same("vision_model.embeddings.position_embedding.weight"),
        **norm("leave", "vision_model.post_layernorm"),
        "query/probe": same(f"{head}.probe"),
        # The file holds queries, keys and values of the head in one array; ours asks with one part and is told by the other two.
        "query/ask/kernel": Source((f"{head}.attention.in_proj_weight",), lambda mix: mix[:width].T),
        "query/ask/bias": Source((f"{head}.attention.in_proj_bias",), lambda mix: mix[:width]),
        "query/tell/kernel": Source((f"{head}.attention.in_proj_weight",), lambda mix: mix[width:].T),
        "query/tell/bias": Source((f"{head}.attention.in_proj_bias",), lambda mix: mix[width:]),
        **dense("query/out", f"{head}.attention.out_proj"),
        **norm("query/norm", f"{head}.layernorm"),
        **dense("query/mlp/widen", f"{head}.mlp.fc1"),
        **dense("query/mlp/narrow", f"{head}.mlp.fc2"),
    }
    text = {
        "words": same("text_model.embeddings.token_embedding.weight"),
        "positions": same("text_model.embeddings.position_embedding.weight"),
        **norm("leave", "text_model.final_layer_norm"),
        "project/kernel": transposed("text_model.head.weight"),
        "project/bias": same("text_model.head.bias"),
    }
    for place in range(arch.image.stack.layers):
        image |= hub_block(f"blocks/{place}", f"vision_model.encoder.layers.{place}")
    for place in range(arch.text.stack.layers):
        text |= hub_block(f"blocks/{place}", f"text_model.encoder.layers.{place}")
    return {"image": image, "text": text, "scoring": {"scale": same("logit_scale"), "bias": same("logit_bias")}}

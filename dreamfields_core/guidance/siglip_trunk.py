"""SigLIP and SigLIP 2 as open_clip writes them: the image tower in timm's names ("visual.trunk..."), the text tower in its own.

open_clip's configuration names the image tower and leaves its numbers to timm, so they stand here. The error unit is the one that
these models were trained with, the tanh formula, which the hub's form states too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from dreamfields_core.guidance.architecture import Architecture, ImageTower, Pixels, Stack, TextTower, UnfitModel
from dreamfields_core.guidance.clip import open_clip_block, patch_kernel
from dreamfields_core.guidance.siglip import HALF, NAFLEX
from dreamfields_core.guidance.tables import Table, dense, norm, same, transposed

SIZES = {
    "base": (768, 12, 12, 3072),
    "large": (1024, 24, 16, 4096),
    "so400m": (1152, 27, 16, 4304),
    "giantopt": (1536, 40, 16, 6144),
}
"""timm's name -> width, layers, heads, width of the MLP's middle."""


def trunk_name(config: Mapping[str, Any]) -> str:
    """timm's name of the image tower in an `open_clip_config.json`; "" where it has none, or is no SigLIP's."""
    image = config.get("model_cfg", config).get("vision_cfg", {})
    name = str(image.get("timm_model_name") or "")
    return name if "siglip" in name else ""


def from_open_clip(config: Mapping[str, Any]) -> Architecture:
    """The architecture in an `open_clip_config.json` whose image tower is one of timm's SigLIPs.

    Raises:
      UnfitModel: a variable-resolution model, or one without the pooling head.
    """
    model, prepare = config.get("model_cfg", config), config.get("preprocess_cfg", {})
    name, text = trunk_name(config), model.get("text_cfg", {})
    if "naflex" in name:
        raise UnfitModel(NAFLEX)
    named = re.fullmatch(r"vit_([a-z0-9]+)_patch(\d+)_siglip_(\d+)", name)
    if named is None or named[1] not in SIZES:
        raise UnfitModel(
            f'expected an image tower such as vit_base_patch16_siglip_224, of size {", ".join(SIZES)}, got "{name}": '
            "use the same model in the hub's form (config.json and model.safetensors)"
        )
    width, layers, heads, hidden = SIZES[named[1]]
    size = model.get("vision_cfg", {}).get("image_size", int(named[3]))
    words = text.get("width", 768)
    return Architecture(
        family="siglip",
        image=ImageTower(Stack(width, layers, heads, hidden), size, int(named[2]), class_token=False, pool="query"),
        text=TextTower(
            Stack(words, text.get("layers", 12), text.get("heads", 12), int(words * text.get("mlp_ratio", 4.0))),
            vocabulary=text.get("vocab_size", 32000),
            length=text.get("context_length", 64),
            positions=text.get("context_length", 64),
            dim=model.get("embed_dim", width),
            project_bias=True,
        ),
        pixels=Pixels(
            size,
            tuple(prepare.get("mean", HALF)),  # type: ignore[arg-type]
            tuple(prepare.get("std", HALF)),  # type: ignore[arg-type]
            prepare.get("interpolation", "bicubic"),
        ),
        layout="open_clip",
        sigmoid=True,
    )


def tables(arch: Architecture) -> dict[str, Table]:
    """Our names to those of an `open_clip_model.safetensors`."""
    trunk, head = "visual.trunk", "visual.trunk.attn_pool"
    image = {
        "patch/kernel": patch_kernel(f"{trunk}.patch_embed.proj.weight"),
        "patch/bias": same(f"{trunk}.patch_embed.proj.bias"),
        "positions": same(f"{trunk}.pos_embed"),
        **norm("leave", f"{trunk}.norm"),
        "query/probe": same(f"{head}.latent"),
        **dense("query/ask", f"{head}.q"),
        **dense("query/tell", f"{head}.kv"),
        **dense("query/out", f"{head}.proj"),
        **norm("query/norm", f"{head}.norm"),
        **dense("query/mlp/widen", f"{head}.mlp.fc1"),
        **dense("query/mlp/narrow", f"{head}.mlp.fc2"),
    }
    text = {
        "words": same("text.token_embedding.weight"),
        "positions": same("text.positional_embedding"),
        **norm("leave", "text.ln_final"),
        "project/kernel": transposed("text.text_projection.weight"),
        "project/bias": same("text.text_projection.bias"),
    }
    for place in range(arch.image.stack.layers):
        image |= _block(f"blocks/{place}", f"{trunk}.blocks.{place}")
    for place in range(arch.text.stack.layers):
        text |= open_clip_block(f"blocks/{place}", f"text.transformer.resblocks.{place}")
    return {"image": image, "text": text, "scoring": {"scale": same("logit_scale"), "bias": same("logit_bias")}}


def _block(ours: str, theirs: str) -> Table:
    return {
        **norm(f"{ours}/norm1", f"{theirs}.norm1"),
        **dense(f"{ours}/attention/mix", f"{theirs}.attn.qkv"),
        **dense(f"{ours}/attention/out", f"{theirs}.attn.proj"),
        **norm(f"{ours}/norm2", f"{theirs}.norm2"),
        **dense(f"{ours}/mlp/widen", f"{theirs}.mlp.fc1"),
        **dense(f"{ours}/mlp/narrow", f"{theirs}.mlp.fc2"),
    }

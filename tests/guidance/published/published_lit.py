"""LiT's files under the published names, from towers of the trusted implementation: nobody there writes them."""

from __future__ import annotations

from typing import Any

import numpy as np
from published_models import siglip_config

VIT_BLOCK = {
    "first": "layernorm_before",
    "second": "layernorm_after",
    "query": "attention.q_proj",
    "key": "attention.k_proj",
    "value": "attention.v_proj",
    "out": "attention.o_proj",
    "widen": "mlp.fc1",
    "narrow": "mlp.fc2",
}
SIGLIP_BLOCK = {
    "first": "layer_norm1",
    "second": "layer_norm2",
    "query": "self_attn.q_proj",
    "key": "self_attn.k_proj",
    "value": "self_attn.v_proj",
    "out": "self_attn.out_proj",
    "widen": "mlp.fc1",
    "narrow": "mlp.fc2",
}
"""The parts of a block, as the library names them in its ViT and in SigLIP's text tower."""


def vit(*, full: bool = False) -> Any:
    """The library's ViT, with LiT's GELU and epsilon."""
    import transformers

    small = {
        "hidden_size": 64,
        "num_hidden_layers": 2,
        "num_attention_heads": 4,
        "intermediate_size": 128,
        "image_size": 32,
        "patch_size": 8,
    }
    usual = {"hidden_act": "gelu_pytorch_tanh", "layer_norm_eps": 1e-6}
    return transformers.ViTModel(transformers.ViTConfig(**({} if full else small), **usual), add_pooling_layer=False)


def bert(*, full: bool = False) -> Any:
    """The library's BERT, with flaxformer's GELU."""
    import transformers

    small = {"hidden_size": 64, "num_hidden_layers": 2, "num_attention_heads": 1, "intermediate_size": 96, "vocab_size": 120}
    config = transformers.BertConfig(**({} if full else small), hidden_act="gelu_pytorch_tanh")
    return transformers.BertModel(config, add_pooling_layer=False)


def plain_text() -> Any:
    """A text transformer that sees all tokens and keeps the last: SigLIP's, which is LiT's as well."""
    import transformers

    return transformers.SiglipTextModel(siglip_config().text_config)


def lit_arrays(image: Any, text: Any, *, old_names: bool, dim: int | None) -> tuple[dict[str, np.ndarray], Any]:
    """A LiT's arrays under the published names, and the reference: the library's two towers and a linear map behind each.

    Args:
      old_names: count the parts of a block as Flax did before Linen.
      dim: of the embedding; None: the image tower has no head and the text's maps to its width.
    """
    import torch

    rng = np.random.default_rng(0)
    width, bert_like = image.config.hidden_size, text.config.model_type == "bert"
    heads = {"txt": rng.normal(0, 0.2, (text.config.hidden_size, dim or width)).astype(np.float32)}
    if dim:
        heads["img"] = rng.normal(0, 0.2, (width, dim)).astype(np.float32)
    biases = {tower: rng.normal(0, 0.2, kernel.shape[1]).astype(np.float32) for tower, kernel in heads.items()}
    arrays = {f"{tower}/head/{kind}": value for kind, all_ in (("kernel", heads), ("bias", biases)) for tower, value in all_.items()}
    arrays |= {"t": np.array([2.0], np.float32)} | _flax_vit(image, old_names) | (_flaxformer(text) if bert_like else _flax_text(text))

    def project(tower: str, pooled: Any) -> Any:
        return pooled @ torch.tensor(heads[tower]) + torch.tensor(biases[tower]) if tower in heads else pooled

    def reference(pictures: Any, tokens: Any) -> tuple[Any, Any]:
        seen = project("img", image(pixel_values=pictures.permute(0, 3, 1, 2)).last_hidden_state[:, 0])
        if bert_like:
            read = project("txt", text(input_ids=tokens, attention_mask=(tokens != 0).long()).last_hidden_state[:, 0])
        else:
            read = project("txt", text(input_ids=tokens).last_hidden_state[:, -1])
        return seen, read

    return arrays, reference


def _kernel(state: dict[str, np.ndarray], theirs: str, ours: str, *, heads: int = 0, leading: bool = True) -> dict[str, np.ndarray]:
    """A dense layer in Flax's layout; split over heads behind (queries, keys, values) or in front (the way out)."""
    kernel, bias = state[f"{theirs}.weight"].T, state[f"{theirs}.bias"]
    if heads and leading:
        kernel, bias = kernel.reshape(kernel.shape[0], heads, -1), bias.reshape(heads, -1)
    elif heads:
        kernel = kernel.reshape(heads, -1, kernel.shape[1])
    return {f"{ours}/kernel": kernel, f"{ours}/bias": bias}


def _scale(state: dict[str, np.ndarray], theirs: str, ours: str) -> dict[str, np.ndarray]:
    return {f"{ours}/scale": state[f"{theirs}.weight"], f"{ours}/bias": state[f"{theirs}.bias"]}


def _flax_block(state: dict[str, np.ndarray], theirs: dict[str, str], ours: str, heads: int, *, old_names: bool) -> dict[str, np.ndarray]:
    kinds = ("LayerNorm_0", "MultiHeadDotProductAttention_1", "LayerNorm_2", "MlpBlock_3")
    kinds = kinds if old_names else ("LayerNorm_0", "MultiHeadDotProductAttention_0", "LayerNorm_1", "MlpBlock_0")
    first, attention, second, mlp = (f"{ours}/{kind}" for kind in kinds)
    out = _scale(state, theirs["first"], first) | _scale(state, theirs["second"], second)
    for part in ("query", "key", "value"):
        out |= _kernel(state, theirs[part], f"{attention}/{part}", heads=heads)
    out |= _kernel(state, theirs["out"], f"{attention}/out", heads=heads, leading=False)
    return out | _kernel(state, theirs["widen"], f"{mlp}/Dense_0") | _kernel(state, theirs["narrow"], f"{mlp}/Dense_1")


def _flax_vit(model: Any, old_names: bool) -> dict[str, np.ndarray]:
    state = {name: value.numpy() for name, value in model.state_dict().items()}
    seen = "embeddings.patch_embeddings.projection"
    out = {
        "img/embedding/kernel": state[f"{seen}.weight"].transpose(2, 3, 1, 0),
        "img/embedding/bias": state[f"{seen}.bias"],
        "img/cls": state["embeddings.cls_token"],
        "img/Transformer/posembed_input/pos_embedding": state["embeddings.position_embeddings"],
        **_scale(state, "layernorm", "img/Transformer/encoder_norm"),
    }
    for place in range(model.config.num_hidden_layers):
        names = {part: f"layers.{place}.{theirs}" for part, theirs in VIT_BLOCK.items()}
        out |= _flax_block(state, names, f"img/Transformer/encoderblock_{place}", model.config.num_attention_heads, old_names=old_names)
    return out


def _flax_text(model: Any) -> dict[str, np.ndarray]:
    state = {name.removeprefix("text_model."): value.numpy() for name, value in model.state_dict().items()}
    out = {
        "txt/Embed_0/embedding": state["embeddings.token_embedding.weight"],
        "txt/pos_embedding": state["embeddings.position_embedding.weight"][None],
        **_scale(state, "final_layer_norm", "txt/Encoder_0/encoder_norm"),
    }
    for place in range(model.config.num_hidden_layers):
        names = {part: f"encoder.layers.{place}.{theirs}" for part, theirs in SIGLIP_BLOCK.items()}
        out |= _flax_block(state, names, f"txt/Encoder_0/encoderblock_{place}", model.config.num_attention_heads, old_names=False)
    return out


def _flaxformer(model: Any) -> dict[str, np.ndarray]:
    state = {name: value.numpy() for name, value in model.state_dict().items()}
    root, heads = "txt/BertEncoder_0", model.config.num_attention_heads
    out = {
        f"{root}/embedder/embedders_{ours}/embedding": state[f"embeddings.{theirs}_embeddings.weight"]
        for ours, theirs in {"token_ids": "word", "position_ids": "position", "segment_ids": "token_type"}.items()
    } | _scale(state, "embeddings.LayerNorm", f"{root}/layer_norm")
    for place in range(model.config.num_hidden_layers):
        theirs, ours = f"encoder.layer.{place}", f"{root}/encoder_block/layer_sequence/layers_{place}"
        for part in ("query", "key", "value"):
            out |= _kernel(state, f"{theirs}.attention.self.{part}", f"{ours}/attention_block/attention_layer/{part}", heads=heads)
        out |= _kernel(state, f"{theirs}.attention.output.dense", f"{ours}/attention_block/dense_layer", heads=heads, leading=False)
        out |= _scale(state, f"{theirs}.attention.output.LayerNorm", f"{ours}/attention_block/layer_norm")
        out |= _kernel(state, f"{theirs}.intermediate.dense", f"{ours}/mlp_block/mlp/dense_layer")
        out |= _kernel(state, f"{theirs}.output.dense", f"{ours}/mlp_block/dense_layer")
        out |= _scale(state, f"{theirs}.output.LayerNorm", f"{ours}/mlp_block/layer_norm")
    return out

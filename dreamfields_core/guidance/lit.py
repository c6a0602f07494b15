"""LiT (Zhai 2022) as Google published it: a locked ViT and a BERT or plain transformer for text, in an npz without pickle.

There is no configuration file: the arrays' names and shapes say it all. The paper's LiT_uu B/32 is not among the published ones.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from dreamfields_core.guidance.architecture import Architecture, ImageTower, Pixels, Stack, TextTower, UnfitModel
from dreamfields_core.guidance.tables import Source, Table, same

LENGTH = 16
"""Tokens of a caption, in every published LiT."""
HALF = (0.5, 0.5, 0.5)
BERT_LAYERS = "txt/BertEncoder_0/encoder_block/layer_sequence"


def from_shapes(shapes: Mapping[str, tuple[int, ...]]) -> Architecture:
    """The architecture of a published LiT.

    Args:
      shapes: name -> shape of every array of the file, names without a leading "params/".

    Raises:
      UnfitModel: arrays that decide the architecture are not there.
    """
    try:
        patch = shapes["img/embedding/kernel"][0]
        tokens = shapes["img/Transformer/posembed_input/pos_embedding"][-2]
        grid = round((tokens - 1) ** 0.5)
        if grid**2 + 1 != tokens:
            raise UnfitModel(f"expected positions for a class token and a square of patches, got {tokens}: this is no LiT")
        image = ImageTower(
            stack=_flax_stack(shapes, "img/Transformer"),
            image_size=grid * patch,
            patch=patch,
            dim=shapes["img/head/kernel"][-1] if "img/head/kernel" in shapes else None,
            project_bias=True,
        )
        text = _bert(shapes) if "txt/BertEncoder_0/layer_norm/scale" in shapes else _plain(shapes)
    except (KeyError, ValueError) as problem:
        if isinstance(problem, UnfitModel):
            raise
        raise UnfitModel(
            f"expected the arrays of a published LiT, got a file without {problem}: "
            "give LiT-B16B.npz, LiT-L16L.npz, LiT-L16S.npz or LiT-L16Ti.npz"
        ) from None
    # The published preprocessing shrinks without an antialiasing filter; a picture of the right size is not touched at all.
    return Architecture("lit", image, text, Pixels(grid * patch, HALF, HALF, "bilinear", antialias=False), "lit")


def _flax_stack(shapes: Mapping[str, tuple[int, ...]], root: str) -> Stack:
    """A stack of Flax's own encoder blocks; its attention kernels are [width, heads, width / heads]."""
    names = _block_names(shapes, f"{root}/encoderblock_0")
    width, heads, _ = shapes[f"{names['attention']}/query/kernel"]
    return Stack(width, _count(shapes, f"{root}/encoderblock_"), heads, shapes[f"{names['mlp']}/Dense_0/kernel"][-1], "gelu_tanh", 1e-6)


def _plain(shapes: Mapping[str, tuple[int, ...]]) -> TextTower:
    vocabulary, _ = shapes["txt/Embed_0/embedding"]
    positions = shapes["txt/pos_embedding"][-2]
    stack = _flax_stack(shapes, "txt/Encoder_0")
    return TextTower(stack, vocabulary, positions, positions, dim=shapes["txt/head/kernel"][-1], project_bias=True)


def _bert(shapes: Mapping[str, tuple[int, ...]]) -> TextTower:
    vocabulary, width = shapes["txt/BertEncoder_0/embedder/embedders_token_ids/embedding"]
    positions, _ = shapes["txt/BertEncoder_0/embedder/embedders_position_ids/embedding"]
    hidden = shapes[f"{BERT_LAYERS}/layers_0/mlp_block/mlp/dense_layer/kernel"][-1]
    query = shapes[f"{BERT_LAYERS}/layers_0/attention_block/attention_layer/query/kernel"]
    heads = query[1] if len(query) == 3 else max(width // 64, 1)
    return TextTower(
        # BERT's error unit is jax.nn.gelu, by the tanh formula.
        Stack(width, _count(shapes, f"{BERT_LAYERS}/layers_"), heads, hidden, "gelu_tanh", 1e-12, norm_first=False),
        vocabulary,
        min(LENGTH, positions),
        positions,
        skip_padding=True,
        enter_norm=True,
        leave_norm=False,
        pool="first",
        dim=shapes["txt/head/kernel"][-1],
        project_bias=True,
    )


def tables(arch: Architecture, names: set[str]) -> dict[str, Table]:
    """Our names to those of the npz; `names` are all that it has, since older Flax numbered the parts of a block differently."""
    image = {
        "patch/kernel": Source(("img/embedding/kernel",), lambda kernel: kernel.reshape(-1, kernel.shape[-1])),
        "patch/bias": same("img/embedding/bias"),
        "class_token": same("img/cls"),
        "positions": same("img/Transformer/posembed_input/pos_embedding"),
        **_norm("leave", "img/Transformer/encoder_norm"),
    }
    for place in range(arch.image.stack.layers):
        image |= _flax_block(f"blocks/{place}", _block_names(names, f"img/Transformer/encoderblock_{place}"))
    if arch.image.dim:
        image |= {"project/kernel": same("img/head/kernel"), "project/bias": same("img/head/bias")}
    text = {"project/kernel": same("txt/head/kernel"), "project/bias": same("txt/head/bias")}
    text |= _bert_table(arch) if arch.text.skip_padding else _plain_table(arch, names)
    return {"image": image, "text": text, "scoring": {"scale": same("t")}}


def _plain_table(arch: Architecture, names: set[str]) -> Table:
    table = {
        "words": same("txt/Embed_0/embedding"),
        "positions": same("txt/pos_embedding"),
        **_norm("leave", "txt/Encoder_0/encoder_norm"),
    }
    for place in range(arch.text.stack.layers):
        table |= _flax_block(f"blocks/{place}", _block_names(names, f"txt/Encoder_0/encoderblock_{place}"))
    return table


def _bert_table(arch: Architecture) -> Table:
    root = "txt/BertEncoder_0/embedder/embedders_"
    table = {
        "words": same(f"{root}token_ids/embedding"),
        # A caption is all segment 0, so its constant goes into the positions.
        "positions": Source((f"{root}position_ids/embedding", f"{root}segment_ids/embedding"), lambda places, parts: places + parts[:1]),
        **_norm("enter", "txt/BertEncoder_0/layer_norm"),
    }
    for place in range(arch.text.stack.layers):
        ours, attention, mlp = f"blocks/{place}", *(f"{BERT_LAYERS}/layers_{place}/{part}_block" for part in ("attention", "mlp"))
        table |= {
            **_attention(ours, f"{attention}/attention_layer", f"{attention}/dense_layer"),
            **_norm(f"{ours}/norm1", f"{attention}/layer_norm"),
            **_dense(f"{ours}/mlp/widen", f"{mlp}/mlp/dense_layer"),
            **_dense(f"{ours}/mlp/narrow", f"{mlp}/dense_layer"),
            **_norm(f"{ours}/norm2", f"{mlp}/layer_norm"),
        }
    return table


def _flax_block(ours: str, theirs: Mapping[str, str]) -> Table:
    return {
        **_norm(f"{ours}/norm1", theirs["norm1"]),
        **_attention(ours, theirs["attention"], f"{theirs['attention']}/out"),
        **_norm(f"{ours}/norm2", theirs["norm2"]),
        **_dense(f"{ours}/mlp/widen", f"{theirs['mlp']}/Dense_0"),
        **_dense(f"{ours}/mlp/narrow", f"{theirs['mlp']}/Dense_1"),
    }


def _attention(ours: str, mix: str, out: str) -> Table:
    """Kernels [width, heads, width / heads] of queries, keys and values side by side, and the way back."""
    parts = [f"{mix}/{part}" for part in ("query", "key", "value")]
    return {
        f"{ours}/attention/mix/kernel": Source(
            tuple(f"{part}/kernel" for part in parts), lambda *k: np.concatenate([kernel.reshape(len(kernel), -1) for kernel in k], axis=1)
        ),
        f"{ours}/attention/mix/bias": Source(
            tuple(f"{part}/bias" for part in parts), lambda *b: np.concatenate([bias.reshape(-1) for bias in b])
        ),
        f"{ours}/attention/out/kernel": Source((f"{out}/kernel",), lambda kernel: kernel.reshape(-1, kernel.shape[-1])),
        f"{ours}/attention/out/bias": same(f"{out}/bias"),
    }


def _dense(ours: str, theirs: str) -> Table:
    return {f"{ours}/kernel": same(f"{theirs}/kernel"), f"{ours}/bias": same(f"{theirs}/bias")}


def _norm(ours: str, theirs: str) -> Table:
    return {f"{ours}/scale": same(f"{theirs}/scale"), f"{ours}/bias": same(f"{theirs}/bias")}


def _block_names(names: Mapping[str, object] | set[str], block: str) -> dict[str, str]:
    """Flax before Linen counted the parts of a block in one row, norm 0, attention 1, norm 2, MLP 3; Linen counts each kind."""
    old = f"{block}/MultiHeadDotProductAttention_1/query/kernel" in names
    kinds = ("LayerNorm_0", "MultiHeadDotProductAttention_1", "LayerNorm_2", "MlpBlock_3")
    new = ("LayerNorm_0", "MultiHeadDotProductAttention_0", "LayerNorm_1", "MlpBlock_0")
    return {part: f"{block}/{kind}" for part, kind in zip(("norm1", "attention", "norm2", "mlp"), kinds if old else new)}


def _count(shapes: Mapping[str, object], prefix: str) -> int:
    return len({found[1] for name in shapes if (found := re.match(re.escape(prefix) + r"(\d+)/", name))})


def ignored(name: str) -> bool:
    """What training left behind in the file."""
    return name.startswith(("opt/", "extra/", "img/pre_logits"))

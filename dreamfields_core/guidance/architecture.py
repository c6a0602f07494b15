"""What a published model is made of, in numbers: enough to build its two towers, nothing about where its weights lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Activation = Literal["gelu", "gelu_tanh", "quick_gelu"]
Layout = Literal["hub", "open_clip", "lit"]
"""Whose names the weights file uses: the hub's (`vision_model.encoder...`), open_clip's (`visual.transformer...`) or LiT's (`img/...`)."""


class UnfitModel(ValueError):
    """A published model that cannot be used; its text is one sentence: expected, got, way out."""


@dataclass(frozen=True)
class Stack:
    """The blocks of a transformer.

    width: of a token. layers: blocks. heads: of the attention, dividing the width. hidden: width of the MLP's middle.
    epsilon: of every layer normalisation. norm_first: before each branch (ViT, CLIP), or after each sum (BERT).
    """

    width: int
    layers: int
    heads: int
    hidden: int
    activation: Activation = "gelu_tanh"
    epsilon: float = 1e-6
    norm_first: bool = True

    def __post_init__(self) -> None:
        if min(self.width, self.layers, self.heads, self.hidden) < 1 or self.width % self.heads:
            raise UnfitModel(
                f"expected a transformer whose heads divide its width, got width {self.width}, heads {self.heads}, layers {self.layers}, "
                f"hidden {self.hidden}: the model's configuration is damaged or of another kind"
            )


@dataclass(frozen=True)
class ImageTower:
    """A vision transformer.

    image_size, patch: pixels a side. class_token: a learned token stands before the patches. enter_norm: a normalisation before the
    blocks (CLIP). pool: take the class token, or ask all tokens with one learned query (SigLIP). dim: of the embedding after a
    linear map; None where the pooled token itself is the embedding. patch_bias, project_bias: whether those maps add a constant.
    """

    stack: Stack
    image_size: int
    patch: int
    class_token: bool = True
    enter_norm: bool = False
    patch_bias: bool = True
    pool: Literal["class", "query"] = "class"
    dim: int | None = None
    project_bias: bool = False

    @property
    def tokens(self) -> int:
        """Patches of a picture, and the class token where there is one."""
        return (self.image_size // self.patch) ** 2 + self.class_token


@dataclass(frozen=True)
class TextTower:
    """A text transformer.

    vocabulary: number of tokens known. length: tokens a caption is padded or cut to. positions: learned positions in the file, at
    least `length`. causal: a token sees only those before it (CLIP). skip_padding: no token sees token 0 (BERT). enter_norm,
    leave_norm: a normalisation before and after the blocks. pool: the highest token id (CLIP's end of text), the last, the first.
    """

    stack: Stack
    vocabulary: int
    length: int
    positions: int
    causal: bool = False
    skip_padding: bool = False
    enter_norm: bool = False
    leave_norm: bool = True
    pool: Literal["highest", "last", "first"] = "last"
    dim: int | None = None
    project_bias: bool = False


@dataclass(frozen=True)
class Pixels:
    """How a picture becomes what the image tower was trained on.

    size: side in pixels. mean, std: per channel, of values in [0, 1]. method: of the resizing. antialias: widen the filter when
    shrinking. fit: the shortest side to `size` and the centre cut out (CLIP), or both sides squashed (SigLIP, LiT).
    """

    size: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    method: Literal["bicubic", "bilinear"] = "bicubic"
    antialias: bool = True
    fit: Literal["shortest", "squash"] = "squash"


@dataclass(frozen=True)
class Architecture:
    """A whole model. sigmoid: it was trained to score pairs by sigmoid(scale x cosine + bias), so its file holds both numbers."""

    family: Literal["clip", "siglip", "lit"]
    image: ImageTower
    text: TextTower
    pixels: Pixels
    layout: Layout
    sigmoid: bool = False

    def __post_init__(self) -> None:
        image, text = self.dim, self.text.dim or self.text.stack.width
        if image != text:
            raise UnfitModel(f"expected two towers with embeddings of one length, got {image} for images and {text} for captions")

    @property
    def dim(self) -> int:
        """Length of an embedding."""
        return self.image.dim or self.image.stack.width

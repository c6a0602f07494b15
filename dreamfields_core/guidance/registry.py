"""Short names of published models, and where each one lies. Any folder or hub repository of a supported family works as well.

The hub states the sha256 of each large file; the download is verified against it, and so is every later load. Where several users of a
file have published the same digest of it, it stands here as well and must hold besides.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from dreamfields_core.guidance.architecture import Activation, Layout

CLIP_TOKENIZER = "openai/clip-vit-large-patch14"
"""All CLIP models of OpenAI's form share one vocabulary; this repository is where it is known to lie as a tokenizer.json."""


@dataclass(frozen=True)
class Published:
    """A model by its short name.

    repository, layout: where it lies on the hub and whose names its file uses. For LiT, `address` is where the npz and its
    vocabulary lie instead. revision: a commit, or None for the newest at the first download, kept from then on.
    sha256: digests that must hold besides the hub's own. image_size: side in pixels. parameters: millions, both towers.
    activation: what the weights were trained with, said here because some configurations leave it out.
    """

    name: str
    family: Literal["clip", "siglip", "lit"]
    repository: str
    layout: Layout
    image_size: int
    parameters: float
    licence: str
    about: str
    activation: Activation | None = None
    tokenizer: str | None = None
    address: str | None = None
    vocabulary: str | None = None
    revision: str | None = None
    sha256: dict[str, str] = field(default_factory=dict)

    @property
    def megabytes(self) -> int:
        """Size of the file in single precision, about."""
        return round(4 * self.parameters)


def _openai(name: str, repository: str, size: int, parameters: float, about: str, *, sha256: str | None = None) -> Published:
    return Published(
        f"clip-{name}",
        "clip",
        repository,
        "open_clip",
        size,
        parameters,
        "MIT",
        about,
        activation="quick_gelu",
        tokenizer=CLIP_TOKENIZER,
        sha256={"open_clip_model.safetensors": sha256} if sha256 else {},
    )


def _laion(name: str, repository: str, size: int, parameters: float, about: str) -> Published:
    return Published(name, "clip", repository, "open_clip", size, parameters, "MIT", about, activation="gelu", tokenizer=CLIP_TOKENIZER)


def _siglip(name: str, size: int, parameters: float, about: str) -> Published:
    return Published(name, "siglip", f"google/{name}", "hub", size, parameters, "Apache-2.0", about)


def _lit(name: str, parameters: float, vocabulary: str, about: str) -> Published:
    address = f"https://storage.googleapis.com/vit_models/lit/{name}"
    short = name.lower()
    return Published(
        short, "lit", "", "lit", 224, parameters, "Apache-2.0", about, address=f"{address}.npz", vocabulary=f"{address}.{vocabulary}"
    )


MODELS: tuple[Published, ...] = (
    _openai(
        "vit-b32",
        "timm/vit_base_patch32_clip_224.openai",
        224,
        151.3,
        "OpenAI's CLIP B/32, the paper's usual judge",
        sha256="e6d1bd7789aa45192b3bf90570a789b478bae1b74ebcce7eddd908e83a2b7c31",
    ),
    _openai(
        "vit-b16",
        "timm/vit_base_patch16_clip_224.openai",
        224,
        149.6,
        "OpenAI's CLIP B/16, the paper's usual guidance",
        sha256="4b8699299b1e8997753c64b052ba32031449d5d853f55a039148560ee02b820f",
    ),
    _openai("vit-l14", "timm/vit_large_patch14_clip_224.openai", 224, 427.6, "OpenAI's CLIP L/14"),
    _openai(
        "vit-l14-336",
        "timm/vit_large_patch14_clip_336.openai",
        336,
        427.9,
        "OpenAI's CLIP L/14 at 336 pixels",
        sha256="fbc415c3d0d7b79faed8f5ccfb740c32b7c4f5ffe7283b851f89c6231c01a8e0",
    ),
    _laion("clip-vit-b32-laion2b", "laion/CLIP-ViT-B-32-laion2B-s34B-b79K", 224, 151.3, "OpenCLIP B/32 on LAION-2B"),
    _laion("clip-vit-b16-laion2b", "laion/CLIP-ViT-B-16-laion2B-s34B-b88K", 224, 149.6, "OpenCLIP B/16 on LAION-2B"),
    _laion("clip-vit-l14-laion2b", "laion/CLIP-ViT-L-14-laion2B-s32B-b82K", 224, 427.6, "OpenCLIP L/14 on LAION-2B"),
    _laion("clip-vit-h14-laion2b", "laion/CLIP-ViT-H-14-laion2B-s32B-b79K", 224, 986.1, "OpenCLIP H/14 on LAION-2B"),
    _laion("clip-vit-b32-datacomp", "laion/CLIP-ViT-B-32-DataComp.XL-s13B-b90K", 224, 151.3, "OpenCLIP B/32 on DataComp-1B"),
    _laion(
        "clip-vit-b32-256-datacomp",
        "laion/CLIP-ViT-B-32-256x256-DataComp-s34B-b86K",
        256,
        151.3,
        "OpenCLIP B/32 on DataComp-1B at 256 pixels",
    ),
    _laion("clip-vit-b16-datacomp", "laion/CLIP-ViT-B-16-DataComp.XL-s13B-b90K", 224, 149.6, "OpenCLIP B/16 on DataComp-1B"),
    _laion("clip-vit-l14-datacomp", "laion/CLIP-ViT-L-14-DataComp.XL-s13B-b90K", 224, 427.6, "OpenCLIP L/14 on DataComp-1B"),
    _siglip("siglip-base-patch16-224", 224, 203.2, "SigLIP B/16"),
    _siglip("siglip-base-patch16-256", 256, 203.2, "SigLIP B/16 at 256 pixels"),
    _siglip("siglip-so400m-patch14-384", 384, 878.0, "SigLIP of 400 M an image tower, 384 pixels"),
    _siglip("siglip2-base-patch32-256", 256, 376.9, "SigLIP 2 B/32: the quickest of the good ones"),
    _siglip("siglip2-base-patch16-224", 224, 375.2, "SigLIP 2 B/16"),
    _siglip("siglip2-base-patch16-256", 256, 375.2, "SigLIP 2 B/16 at 256 pixels"),
    _siglip("siglip2-large-patch16-256", 256, 881.5, "SigLIP 2 L/16 at 256 pixels"),
    _lit("LiT-B16B", 195.9, "txt", "LiT with ViT-B/16 and BERT-base; the paper's LiT B/32 was never released"),
    _lit("LiT-L16L", 638.4, "txt", "LiT with ViT-L/16 and BERT-large"),
    _lit("LiT-L16S", 331.1, "model", "LiT with ViT-L/16 and a small text tower"),
    _lit("LiT-L16Ti", 311.9, "model", "LiT with ViT-L/16 and a tiny text tower"),
)
"""Every short name. The parameter counts decide nothing; they tell what will be downloaded, about."""

NAMES = {model.name: model for model in MODELS}


def known(name: str) -> Published | None:
    """The model of this short name, or of this repository, whose files may leave out what is said here."""
    return NAMES.get(name) or next((model for model in MODELS if name and model.repository == name), None)

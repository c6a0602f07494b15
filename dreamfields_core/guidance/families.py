"""The three families that are supported, by what their files say. Nothing here starts JAX: a model's card must be cheap."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from dreamfields_core.guidance import clip, lit, siglip, siglip_trunk
from dreamfields_core.guidance.architecture import Architecture, UnfitModel
from dreamfields_core.guidance.tables import Table


def read_architecture(config: Mapping[str, Any], *, second: bool = False) -> Architecture:
    """The architecture in a `config.json` or an `open_clip_config.json`.

    Args:
      second: a SigLIP 2, which its configuration alone does not tell from a SigLIP: its tokenizer has <eos>, not </s>.

    Raises:
      UnfitModel: a family that is not supported, or numbers that cannot be.
    """
    try:
        if "model_cfg" in config and siglip_trunk.trunk_name(config):
            return siglip_trunk.from_open_clip(config)
        if "model_cfg" in config:
            return clip.from_open_clip(config)
        if config.get("model_type") == "clip":
            return clip.from_hub(config)
        if config.get("model_type") in ("siglip", "siglip2"):
            return siglip.from_hub(config, second=second)
    except (TypeError, AttributeError, ZeroDivisionError) as problem:
        raise UnfitModel(f"expected a model's configuration, got one whose values have wrong kinds ({problem}): fetch it again") from None
    kind = config.get("model_type", "none at all")
    raise UnfitModel(f'expected a model of type clip or siglip, got "{kind}": `dreamfields models` lists those that work')


def read_tables(arch: Architecture, names: Collection[str]) -> tuple[Mapping[str, Table], Callable[[str], bool]]:
    """Our names to the file's, for "image", "text" and "scoring"; and which other names in the file are known and of no use.

    Args:
      names: all names in the file.
    """
    if arch.layout == "lit":
        return lit.tables(arch, set(names)), lit.ignored
    if arch.layout == "open_clip":
        return (siglip_trunk.tables if arch.family == "siglip" else clip.open_clip_tables)(arch), clip.ignored
    return (siglip.tables if arch.family == "siglip" else clip.hub_tables)(arch), clip.ignored

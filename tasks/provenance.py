"""Where an object comes from, as its files say it."""

from __future__ import annotations

from typing import Any

from dreamfields_core.config import parts
from storage.digests import json_digest
from tasks.encoders import EncoderError, describe_encoders, members
from tasks.step import Work
from tasks.steps import OPTIMIZE


def provenance(work: Work) -> dict[str, Any]:
    """Of a mesh, JSON-able: nothing in it that the mesh does not hang on, so that one mesh has one file.

    config_digest: over the parts of the configuration that the field was optimised by. field, step: digests of what it was made from,
    and the key of the record that says how.
    """
    guide = work.config.guidance.name
    return {
        "generator": "dreamfields",
        "caption": work.text("caption"),
        "seed": work.config.seed,
        "config_digest": json_digest(parts(work.config, OPTIMIZE.reads)),
        "guidance": {"name": guide, "digest": work.text("guide")},
        "field": work.digest("field"),
        "step": work.key,
        "licence": f"the object is its maker's own; guided by {guide}, whose weights are under {licence(guide)}",
    }


def licence(name: str) -> str:
    """Of an image-text model's weights, or of all that an ensemble is made of."""
    known = {row["name"]: str(row["licence"]) for row in describe_encoders()}
    try:
        models = [member for member, _ in members(name)]
    except EncoderError:  # a folder that has gone since, whose name looks like an ensemble's
        models = [name]
    return ", ".join(dict.fromkeys(known.get(model, "a licence of their own") for model in models))

"""What a dream leaves behind: a folder with its files and result.json, and the same facts as a record in the store."""

from __future__ import annotations

import json
from typing import Any

from flows.order import Order
from flows.recipe import Dream
from storage.artifacts import ArtifactRef, export
from storage.contract import Store
from storage.digests import json_digest
from storage.local import write_file
from storage.steps import StepRecord, put_record
from tasks.encoders import card
from tasks.version import code_version

KEEPSAKES = ("mesh.glb", "contact_sheet.png", "turntable.mp4", "turntable.webp", "preview.png", "field.safetensors", "history.npz")
"""Outputs that are copied into the folder; the others stay in the store."""


def leave(order: Order, dream: Dream, store: Store) -> dict[str, Any]:
    """Write the folder and the record; what result.json says.

    Raises: StorageError.
    """
    result = describe(order, dream, store)
    for ref in outputs(dream):
        if ref.name in KEEPSAKES:
            export(store, ref, order.folder / ref.name)
    put_record(store, _record(order, dream, result))
    write_file(order.folder / "result.json", (json.dumps(result, indent=2, ensure_ascii=False) + "\n").encode())
    return result


def outputs(dream: Dream) -> list[ArtifactRef]:
    """Every file of every step."""
    return [ref for done in dream.steps for ref in done.record.outputs]


def describe(order: Order, dream: Dream, store: Store) -> dict[str, Any]:
    """The facts of a dream, JSON-able."""
    guide, judge = card(order.config.guidance.name), card(order.config.evaluate.judge)
    return {
        "caption": order.caption,
        "preset": order.preset,
        "seed": order.config.seed,
        "config": order.config.model_dump(mode="json"),
        "config_digest": order.config_digest,
        "code_version": code_version(),
        "encoders": {
            "guidance": {"name": guide.name, "digest": guide.digest},
            "judge": {"name": judge.name, "digest": judge.digest},
            "same_model": guide.shares_weights(judge),
        },
        "unknown_words": list(order.unknown_words),
        "seconds": {done.record.step: done.record.seconds for done in dream.steps},
        "scores": {judge.name: _score(dream.score.record.values)},
        "mesh": dream.mesh.record.values,
        "artifacts": [ref.to_json() for ref in outputs(dream)],
        "store": store.url,
    }


def _score(values: dict[str, Any]) -> dict[str, Any]:
    """The paper's score first (field, held-out view, the random pool), then all the others."""
    first = values["field"]["random"]
    head = {"cosine": first["similarity"], "rank": first["rank"], "correct": first["correct"], "pool": first["pool"]}
    return {**head, "field": values["field"], "mesh": values["mesh"]}


def _record(order: Order, dream: Dream, result: dict[str, Any]) -> StepRecord:
    """So that the store alone tells which dreams it holds."""
    return StepRecord(
        step="dream",
        version=1,
        key=json_digest([order.caption, result["config"]]),
        config=result["config"],
        inputs={"caption": order.caption},
        code_version=result["code_version"],
        seconds=round(sum(result["seconds"].values()), 3),
        outputs=tuple(outputs(dream)),
        values={name: result[name] for name in ("preset", "seed", "config_digest", "encoders", "scores", "mesh", "seconds")},
    )

"""What a dream leaves behind: a folder with its files and result.json, and the same facts as a record in the store."""

from __future__ import annotations

import json
import re
from typing import Any

from flows.order import Order
from flows.recipe import STEPS, Conductor, Dream, make_object
from flows.view import VIEW, view_page
from storage.artifacts import ArtifactRef, export, get_artifact
from storage.contract import Store
from storage.local import write_file
from storage.steps import StepRecord, find_record, put_record
from tasks.encoders import card
from tasks.pools import keep_pool
from tasks.version import code_version

KEEPSAKES = re.compile(
    r"mesh(_lod\d+)?\.glb|(mesh_)?turntable\w*\.mp4|turntable\.webp|contact_sheet\.png|preview\.png|field\.safetensors|history\.npz"
)
"""Names of outputs that are copied into the folder; the others stay in the store."""
WHOLE, SCORED = "dream", "scored"
"""Kinds of records: of an object with all that belongs to it, and of one that was only scored."""
FACTS = ("preset", "seed", "config_digest", "encoders", "unknown_words", "seconds", "scores", "mesh")
"""What the record in the store holds of result.json beside its own fields."""


def fulfil(order: Order, conduct: Conductor, store: Store) -> dict[str, Any]:
    """Have the object of an order made, and leave it; what result.json says. Raises: whatever a step raises."""
    pool = keep_pool(store, order.among)
    made = make_object(conduct, order.caption, order.config, pool=pool, judges=order.judges, score_only=order.score_only)
    return leave(order, made, store)


def leave(order: Order, dream: Dream, store: Store) -> dict[str, Any]:
    """Write the folder and the record; what result.json says.

    Raises: StorageError.
    """
    result = describe(order, dream, store)
    kept = [ref for ref in outputs(dream) if KEEPSAKES.fullmatch(ref.name)]
    for ref in kept:
        export(store, ref, order.folder / ref.name)
    if dream.mesh:
        page = view_page(result, get_artifact(store, dream.mesh.output("mesh.glb")), [ref.name for ref in kept])
        write_file(order.folder / VIEW, page)
    put_record(store, _record(order, dream, result))
    write_file(order.folder / "result.json", (json.dumps(result, indent=2, ensure_ascii=False) + "\n").encode())
    return result


def outputs(dream: Dream) -> list[ArtifactRef]:
    """Every file of every step."""
    return [ref for done in dream.steps for ref in done.record.outputs]


def describe(order: Order, dream: Dream, store: Store) -> dict[str, Any]:
    """The facts of a dream, JSON-able."""
    guide, judge = card(order.config.guidance.name), card(order.config.evaluate.judge)
    others = {name: card(name).digest for name in dream.scores if name != judge.name}
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
            "judges": {judge.name: judge.digest, **others},
        },
        "unknown_words": list(order.unknown_words),
        "seconds": {done.record.step: done.record.seconds for done in dream.steps},
        "scores": {name: told_score(score.values) for name, score in dream.scores.items()},
        "mesh": dream.mesh.record.values if dream.mesh else None,
        "artifacts": [ref.to_json() for ref in outputs(dream)],
        "store": store.url,
    }


def told_score(values: dict[str, Any]) -> dict[str, Any]:
    """A score as result.json has it: the paper's first (field, held-out view, the random pool), then all the others."""
    first = values["field"]["random"]
    head = {"cosine": first["similarity"], "rank": first["rank"], "correct": first["correct"], "pool": first["pool"]}
    return head | values


def _record(order: Order, dream: Dream, result: dict[str, Any]) -> StepRecord:
    """So that the store alone tells which dreams it holds."""
    versions = {done.record.step: done.record.version for done in dream.steps}
    return StepRecord(
        step=WHOLE if dream.mesh else SCORED,
        version=1,
        key=order.key,
        config=result["config"],
        inputs={"caption": order.caption},
        code_version=result["code_version"],
        seconds=round(sum(result["seconds"].values()), 3),
        outputs=tuple(outputs(dream)),
        values={name: result[name] for name in FACTS} | {"versions": versions, "among": list(order.among)},
    )


def find_dream(store: Store, order: Order) -> StepRecord | None:
    """The record of the dream, if all that is wanted is there and today's steps and models would give the same.

    Of an object store only the sizes of the files are asked: to prove their digests would be to download everything.
    """
    kinds, digests = (WHOLE, SCORED) if order.score_only else (WHOLE,), store.local_path("blobs") is not None
    found = (find_record(store, kind, order.key, digests=digests) for kind in kinds)
    return next((record for record in found if record and _is_todays(record, order)), None)


def find_made(store: Store, key: str, *, digests: bool = True) -> StepRecord | None:
    """What was made of an object last, with its mesh if it has one; of the same second, the whole object."""
    found = (find_record(store, kind, key, digests=digests) for kind in (WHOLE, SCORED))
    return max((record for record in found if record), key=lambda record: record.created, default=None)


def _is_todays(record: StepRecord, order: Order) -> bool:
    encoders, wanted = record.values["encoders"], dict.fromkeys([order.config.evaluate.judge, *order.judges])
    judged = {name: card(name).digest for name in wanted}.items() <= encoders.get("judges", {}).items()
    if not judged or encoders["guidance"]["digest"] != card(order.config.guidance.name).digest:
        return False
    versions = {step.name: step.version for step in STEPS}
    made: dict[str, Any] = record.values.get("versions") or {"": 0}
    return made.items() <= versions.items()


def told(record: StepRecord, store: Store) -> dict[str, Any]:
    """What result.json says, from the record alone."""
    facts = {name: record.values.get(name) for name in FACTS}
    artifacts = [ref.to_json() for ref in record.outputs]
    return {
        "caption": record.inputs["caption"],
        "config": record.config,
        "code_version": record.code_version,
        **facts,
        "artifacts": artifacts,
        "store": store.url,
    }

"""Dreams that were never dreamed: a small mesh and the record of it, as a finished dream leaves them."""

from __future__ import annotations

from functools import cache
from typing import Any

from storage.artifacts import put_artifact
from storage.contract import Store
from storage.digests import json_digest
from storage.steps import StepRecord, put_record


@cache
def glb() -> bytes:
    """A small textured mesh."""
    from dreamfields_core.meshing import to_glb
    from tests.meshing.textured import globe

    return to_glb(globe(3, side=8), {"caption": "a globe"})


def keep_dream(store: Store, caption: str = "a red mushroom", *, seed: int = 0, cosine: float = 0.3, **more: Any) -> StepRecord:
    """Put the files and the record of a dream into the store. more: created, mesh (bytes), files (name -> bytes)."""
    files = {"mesh.glb": more.get("mesh") or f"mesh of {caption}, seed {seed}".encode(), **more.get("files", {})}
    outputs = tuple(put_artifact(store, name, data, "application/octet-stream") for name, data in files.items())
    values = {
        "preset": "draft",
        "seed": seed,
        "config_digest": json_digest(seed),
        "encoders": {"guidance": {"name": "embedded", "digest": "a" * 64}, "judge": {"name": "judge", "digest": "b" * 64}},
        "scores": {"judge": {"cosine": cosine, "rank": 2, "correct": False, "pool": 153, "field": {}, "mesh": {}}},
        "mesh": {"level": 1.0, "mesh": {"faces": 12, "watertight": True}},
        "seconds": {"optimize": 1.0},
    }
    record = StepRecord(
        step="dream",
        version=1,
        key=json_digest([caption, seed]),
        config={"seed": seed},
        inputs={"caption": caption},
        code_version="0.1.0+abc",
        created=more.get("created", "2026-11-20T12:00:00+00:00"),
        outputs=outputs,
        values=values,
    )
    return put_record(store, record)

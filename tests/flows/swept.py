"""Dreams as a store holds them, without having dreamt: pictures that can be told apart, histories, records."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from dreamfields_core.png import png
from dreamfields_core.rendering.pictures import webp_animation
from storage.artifacts import ArtifactRef, put_artifact
from storage.contract import Store
from storage.digests import json_digest
from storage.steps import StepRecord, put_record
from tests.reporting.objects import JUDGE, result

FRAMES, SIDE, STEPS = 4, 32, 200


def keep_dream(
    store: Store, caption: str, seed: int, *, rank: int = 1, shade: int = 0, learning: dict[str, list[int]] | None = None
) -> StepRecord:
    """A record of step "dream" with its files; of another shade, another turntable. learning: steps and ranks on the way."""
    rng = np.random.default_rng([seed, shade, *caption.encode()])
    frames = [np.full((SIDE, SIDE, 3), color, np.uint8) for color in rng.integers(0, 256, (FRAMES, 3))]
    history = io.BytesIO()
    steps = np.arange(STEPS, dtype=np.float32)
    np.savez(history, loss=-steps / STEPS, similarity=steps / STEPS, transmittance=np.full(STEPS, 0.8, np.float32), bad=np.zeros(STEPS))
    outputs = (
        put_artifact(store, "turntable.webp", webp_animation(frames), "image/webp"),
        put_artifact(store, "contact_sheet.png", png(frames[0]), "image/png"),
        put_artifact(store, "mesh.glb", f"mesh of {caption} {seed}".encode(), "model/gltf-binary"),
        put_artifact(store, "history.npz", history.getvalue(), "application/x-npz"),
        put_artifact(store, "field.safetensors", b"large", "application/x-safetensors"),
    )
    return _keep(store, "dream", caption, seed, outputs, _scores(rank, learning))


def keep_scored(store: Store, caption: str, seed: int, *, rank: int = 1) -> StepRecord:
    """A record of an object that was only scored: views, no turntable, no mesh."""
    views = io.BytesIO()
    np.savez(views, views=np.random.default_rng(seed).random((2, SIDE, SIDE, 3), np.float32), origin=np.zeros(3))
    scores = {judge: {name: said for name, said in found.items() if name != "mesh"} for judge, found in _scores(rank, None).items()}
    outputs = (put_artifact(store, "views.npz", views.getvalue(), "application/x-npz"),)
    return _keep(store, "scored", caption, seed, outputs, scores)


def _keep(store: Store, kind: str, caption: str, seed: int, outputs: tuple[ArtifactRef, ...], scores: dict[str, Any]) -> StepRecord:
    return put_record(
        store,
        StepRecord(
            step=kind,
            version=1,
            key=json_digest([caption, seed]),
            config={"seed": seed},
            inputs={"caption": caption},
            outputs=outputs,
            values={"scores": scores, "seed": seed, "judge": JUDGE},
        ),
    )


def _scores(rank: int, learning: dict[str, list[int]] | None) -> dict[str, Any]:
    scores: dict[str, Any] = result(rank)["scores"]
    return {judge: said | ({"learning": learning} if learning else {}) for judge, said in scores.items()}

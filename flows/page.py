"""What a flow run's page shows: progress, the picture taking shape, the finished views, and the score."""

from __future__ import annotations

import base64
from typing import Any
from uuid import UUID

import numpy as np
from prefect.artifacts import (
    create_image_artifact,
    create_markdown_artifact,
    create_progress_artifact,
    create_table_artifact,
    update_progress_artifact,
)
from prefect.logging import get_run_logger

from dreamfields_core.png import read_png
from dreamfields_core.rendering.pictures import thumbnail, webp
from flows.order import Order
from flows.pace import Pace
from storage.artifacts import get_artifact
from storage.contract import Store
from tasks.step import Event

SECONDS = 2.0
"""Between two updates of the progress: each is a request."""
PICTURE_SECONDS = 20.0
WIDTH = 720
"""Of pictures on the page, pixels; they lie in Prefect's database."""


class Progress:
    """Hears the events of the optimisation and passes on what a page needs."""

    def __init__(self, steps: int) -> None:
        self._steps = steps
        self._artifact: UUID | None = None
        self._pace, self._picture_pace = Pace(SECONDS), Pace(PICTURE_SECONDS)

    def __call__(self, event: Event) -> None:
        """Show one event."""
        if event["event"] == "step":
            self._on_step(event)
        elif event["event"] == "preview":
            self._on_preview(event)
        elif event["event"] == "asked":
            self._on_asked(event)
        elif event["event"] in ("note", "resumed", "rolled_back", "stopped", "saved"):
            facts = ", ".join(f"{name} {value}" for name, value in event.items() if name != "event")
            get_run_logger().info("%s: %s", event["event"], facts)

    def _on_step(self, event: Event) -> None:
        if not self._pace.is_due(anyway=event["step"] == self._steps):
            return
        share = 100.0 * event["step"] / self._steps
        if self._artifact is None:
            self._artifact = create_progress_artifact(share, key="dream-progress", description=f"Optimising, {self._steps} steps")  # type: ignore[assignment]
        else:
            update_progress_artifact(self._artifact, share)
        get_run_logger().info(
            "step %d of %d: loss %.3f, transmittance %.2f", event["step"], self._steps, event["loss"], event["transmittance"]
        )

    def _on_asked(self, event: Event) -> None:
        """How many points are left nobody knows before the surface is found: a number, no share."""
        if self._pace.is_due():
            get_run_logger().info("mesh: %d points asked", event["points"])

    def _on_preview(self, event: Event) -> None:
        if not self._picture_pace.is_due():
            return
        with open(event["path"], "rb") as file:
            show_picture(file.read(), key="dream-preview", description="The field so far")


def show_picture(data: bytes, *, key: str, description: str) -> None:
    """A PNG as a small picture that lives in the page itself."""
    small = webp(thumbnail(read_png(data), width=WIDTH))
    create_image_artifact("data:image/webp;base64," + base64.b64encode(small).decode(), key=key, description=description)


def show_result(order: Order, result: dict[str, Any], store: Store) -> None:
    """The contact sheet, the scores as a table, and where everything is."""
    for sheet in (ref for ref in result["artifacts"] if ref["name"] == "contact_sheet.png"):
        show_picture(_bytes(store, sheet), key="dream-views", description=f"{order.caption}: colour, depth, transmittance")
    create_table_artifact(_score_rows(result), key="dream-score", description=f"The judge on “{order.caption}”")
    create_markdown_artifact(_summary(order, result), key="dream-summary", description=order.caption)


def _bytes(store: Store, ref: dict[str, Any]) -> bytes:
    from storage.artifacts import ArtifactRef

    return get_artifact(store, ArtifactRef.from_json(ref))


def _score_rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "judge": judge,
            "pictures of": what,
            "pool": f"{pool}, {retrieval['pool']} captions",
            "cosine": round(retrieval["similarity"], 4),
            "rank": retrieval["rank"],
            "correct": retrieval["correct"],
            "R-Precision of the views": float(np.mean([rank == 1 for rank in retrieval["ranks"]])),
        }
        for judge, scores in result["scores"].items()
        for what in ("field", "mesh")
        if what in scores
        for pool, retrieval in scores[what].items()
    ]


def _summary(order: Order, result: dict[str, Any]) -> str:
    seconds = "\n".join(f"| {name} | {spent:.1f} |" for name, spent in result["seconds"].items())
    files = "\n".join(f"| {ref['name']} | {ref['size']} | `{ref['uri']}` |" for ref in result["artifacts"])
    return (
        f"# {order.caption}\n\nPreset {order.preset}, seed {result['seed']}, configuration `{order.config_digest[:12]}`, "
        f"code {result['code_version']}.\n\nFiles in `{order.folder}`; store `{order.store}`.\n\n"
        f"| step | seconds |\n| --- | --- |\n{seconds}\n\n| file | bytes | address |\n| --- | --- | --- |\n{files}\n"
    )

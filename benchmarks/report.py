"""The report of a sweep over many cached objects: seconds from the store to the page, the first time and again.

Objects have what a draft dream leaves for a page, in its sizes: a turntable, a contact sheet, a mesh and a history, no two alike. They are
drawn, not dreamed, since a page does not know the difference. The first time every file is copied beside the page; again, none is.
"""

from __future__ import annotations

import io
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.drawing import sheet
from benchmarks.timing import Times
from dreamfields_core.png import png
from dreamfields_core.rendering.pictures import webp_animation
from flows.report import write_page
from flows.sweep_record import Member, entries
from flows.sweep_report import page_of, report_of
from storage.artifacts import ArtifactRef, put_artifact
from storage.contract import Store
from storage.steps import StepRecord, put_record
from storage.store import open_store
from tasks.encoders import SHIPPED

VARIANTS, STEPS, PIXELS, FRAMES = 4, 300, 256, 4
JUDGE = list(SHIPPED)[-1]


@dataclass(frozen=True)
class Options:
    """objects: cached in the store. mesh_bytes: of each one's mesh. rounds: of building the page again."""

    objects: int = 1000
    mesh_bytes: int = 600_000
    rounds: int = 3


def run(options: Options) -> dict[str, Any]:
    """A row for the first time, and one for the times after."""
    with tempfile.TemporaryDirectory() as folder:
        store, out = open_store(Path(folder) / "store"), Path(folder) / "out"
        sweep = kept(store, options)
        first, again = Times(), Times()
        first.add(partial(build, sweep, store, out))
        for _ in range(options.rounds):
            again.add(partial(build, sweep, store, out))
        size = page_of(sweep, out).stat().st_size
    rows = [{"way": name, **times.row()} for name, times in (("first", first), ("again", again))]
    headline = {f"{row['way']}_{clock}": row[clock]["median"] for row in rows for clock in ("wall_s", "processor_s")}
    return {"headline": headline | {"page_bytes": size}, "clock": "both", "options": options.__dict__, "rows": rows}


def build(sweep: StepRecord, store: Store, out: Path) -> None:
    """What `dreamfields report` does."""
    write_page(report_of(sweep, list(entries(sweep, store, out))), page_of(sweep, out))


def kept(store: Store, options: Options) -> StepRecord:
    """The objects in the store, and the sweep that they belong to."""
    members = [_object(store, number, options.mesh_bytes) for number in range(options.objects)]
    said = {"name": "many", "source": "drawn", "table": None, "preset": "draft", "judges": [JUDGE]}
    values = {**said, "entries": [vars(member) for member in members], "oracle": []}
    return put_record(store, StepRecord("sweep", 1, f"{0:064x}", values=values))


def _object(store: Store, number: int, mesh_bytes: int) -> Member:
    rng = np.random.default_rng(number)
    caption, variant, seed = f"a thing number {number // (2 * VARIANTS)}", f"variant {number % VARIANTS}", number // VARIANTS % 2
    colors = np.kron(rng.integers(0, 256, (8, 8, 3)), np.ones((PIXELS // 8, PIXELS // 8, 1))).astype(np.uint8)
    films = webp_animation([np.roll(colors, 16 * frame, axis=1) for frame in range(FRAMES)])
    files = {
        "turntable.webp": films,
        "contact_sheet.png": png(np.tile(colors, (3, 4, 1))),
        "mesh.glb": rng.bytes(mesh_bytes),
        "history.npz": _history(rng),
    }
    outputs: tuple[ArtifactRef, ...] = tuple(put_artifact(store, name, data, "application/octet-stream") for name, data in files.items())
    ranks = [int(rank) for rank in rng.integers(1, 4, 11)]
    said = {"similarity": 0.25, "rank": ranks[-1], "correct": ranks[-1] == 1, "similarities": [0.25], "ranks": ranks[-1:], "pool": 153}
    pools = {"random": said, "hard": {**said, "pool": 31}}
    learning = {"steps": list(range(STEPS // 10, STEPS + 1, STEPS // 10)), "ranks": ranks[:10]}
    scores = {JUDGE: {"cosine": 0.25, **said, "field": pools, "mesh": pools, "learning": learning}}
    values = {"scores": scores, "seed": seed, "seconds": {"optimize": 25.0}, "encoders": {"same_model": False}}
    key = f"{number:064x}"
    put_record(store, StepRecord("dream", 1, key, config={"seed": seed}, inputs={"caption": caption}, outputs=outputs, values=values))
    return Member(variant, caption, seed, key)


def _history(rng: np.random.Generator) -> bytes:
    file, steps = io.BytesIO(), np.arange(STEPS, dtype=np.float32)
    noise = rng.normal(size=(3, STEPS)).astype(np.float32)
    np.savez(file, loss=noise[0] - steps / STEPS, similarity=noise[1] + steps / STEPS, transmittance=noise[2], bad=np.zeros(STEPS))
    return file.getvalue()


def plot(result: dict[str, Any], path: Path) -> None:
    """Seconds, the first time and again."""
    with sheet(path) as panels:
        for place, clock in enumerate(("wall_s", "processor_s")):
            heights = [row[clock]["median"] for row in result["rows"]]
            panels[0].bar([name + 0.4 * place for name in range(len(heights))], heights, width=0.35, label=clock)
        panels[0].set(xticks=[0.2, 1.2], xticklabels=[row["way"] for row in result["rows"]], ylabel="seconds", title="report")

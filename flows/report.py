"""What the page of a sweep needs beside it, and the same report on the page of a flow run."""

from __future__ import annotations

import base64
import io
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from prefect.artifacts import create_image_artifact, create_table_artifact
from prefect.context import FlowRunContext

from dreamfields_core.rendering.pictures import webp
from dreamfields_core.reporting.cells import plain_rows, result_table
from dreamfields_core.reporting.contract import History, Report
from dreamfields_core.reporting.curves import QUANTITIES, thin
from dreamfields_core.reporting.gallery import LINKS
from dreamfields_core.reporting.page import render_report
from dreamfields_core.reporting.pictures import montage, still
from storage.artifacts import ArtifactRef, export, get_artifact
from storage.contract import Store
from storage.errors import DamagedArtifact, MissingArtifact
from storage.local import write_file
from storage.steps import StepRecord

TURNTABLE, POSTER, VIEWS = "turntable.webp", "poster.webp", "views.npz"
SHOWN = {TURNTABLE, *LINKS}
MONTAGE = 48
"""Objects on the picture of a flow run's page; it lies in Prefect's database."""


def write_page(report: Report, path: Path) -> Path:
    """The page, whole or not at all; files of its entries are relative to its folder. Raises: StorageFull, StoreNotWritable."""
    write_file(path, render_report(report).encode("utf-8"))
    return path


def lay_out(dream: StepRecord, store: Store, out: Path, folder: str) -> dict[str, str]:
    """Copy what the page shows of an object to `out`/`folder`, as far as it is not there; name -> path relative to `out`.

    Of the turntable a still is kept in `out`/posters, so that a page of a thousand objects does not begin with a thousand films; without a
    turntable, the first picture that the judge saw. What the store has lost is left out, as is what nobody has made; a view page or
    result.json that is in the folder already is shown too.

    Raises: StorageFull, StoreNotWritable, StoreUnreachable.
    """
    files = {}
    for ref in dream.outputs:
        if ref.name in SHOWN:
            with suppress(MissingArtifact, DamagedArtifact):
                export(store, ref, out / folder / ref.name)
                files[ref.name] = f"{folder}/{ref.name}"
    source = {ref.name: ref for ref in dream.outputs}.get(TURNTABLE if TURNTABLE in files else VIEWS)
    if source:
        with suppress(MissingArtifact, DamagedArtifact):
            files[POSTER] = _poster(out, source, store)
    beside = {name: f"{folder}/{name}" for name in LINKS if name not in files and (out / folder / name).is_file()}
    return files | beside


def read_history(dream: StepRecord, store: Store) -> History | None:
    """An object's learning curves, thinned for the page; None where the store has none that can be read.

    R-Precision on the way is the first judge's, from glimpses of the field.
    """
    try:
        data = get_artifact(store, dream.output("history.npz"))
    except (KeyError, MissingArtifact, DamagedArtifact):
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as columns:
        curves = {name: columns[name] for name in QUANTITIES if name in columns.files}
    length = max((len(column) for column in curves.values()), default=0)
    scores: list[dict[str, Any]] = list(dream.values["scores"].values())
    if scores and (learning := scores[0].get("learning")):
        curves["correct"] = np.full(length, np.nan)
        curves["correct"][np.asarray(learning["steps"]) - 1] = np.asarray(learning["ranks"]) == 1
    return thin({"step": range(1, length + 1), **curves}) if length else None


def show_report(report: Report, out: Path) -> None:
    """The table, the objects and the failures on the page of the flow run that this is called in; nothing outside of one.

    out: the folder that the entries' files are relative to.
    """
    if FlowRunContext.get() is None:
        return
    rows = [{"judge": judge} | row for judge in report.judges for row in plain_rows(result_table(report, judge))]
    create_table_artifact(rows, key="sweep-table", description=f"{report.title}: R-Precision in percent with its standard error")
    failures: list[dict[str, Any]] = [
        {"caption": entry.caption, "variant": entry.variant, "seed": entry.seed, "why": entry.error or ""}
        for entry in report.entries
        if entry.result is None
    ]
    if failures:
        create_table_artifact(failures, key="sweep-failures", description="Could not be dreamed")
    posters = [out / entry.files[POSTER] for entry in report.entries if POSTER in entry.files][:MONTAGE]
    if posters:
        sheet = montage([still(path.read_bytes()) for path in posters], columns=8, side=128)
        address = "data:image/webp;base64," + base64.b64encode(webp(sheet)).decode()
        create_image_artifact(address, key="sweep-gallery", description=f"{report.title}: {len(posters)} of {len(report.entries)} objects")


def _poster(out: Path, source: ArtifactRef, store: Store) -> str:
    """Named by the file that it is taken from, so that it never shows another."""
    path = f"posters/{source.sha256[:16]}.webp"
    if not (out / path).is_file():
        data = get_artifact(store, source)
        write_file(out / path, webp(still(data) if source.name == TURNTABLE else _first_view(data)))
    return path


def _first_view(views: bytes) -> np.ndarray:
    """uint8 [H, W, 3]."""
    with np.load(io.BytesIO(views), allow_pickle=False) as seen:
        return np.round(255 * seen["views"][0]).astype(np.uint8)

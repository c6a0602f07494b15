"""How far a table agrees with the paper: pairs of rows, told apart there and here."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import tables
from dreamfields_core.rendering.pictures import webp
from dreamfields_core.reporting.contract import Entry, Figure, Report, Row
from dreamfields_core.reporting.statistics import by_variant

CAPTIONS = [f"a thing of kind {number}" for number in range(10)]


def entries(variant: str, found: range) -> list[Entry]:
    """Ten objects of which the judge finds these."""
    said = [{"correct": place in found, "rank": 1 if place in found else 9, "similarity": 0.5} for place in range(10)]
    return [Entry(variant, c, 0, {"scores": {"j": {"field": {"random": one, "hard": one}}}}) for c, one in zip(CAPTIONS, said, strict=True)]


def row(name: str, percent: float, error: float = 1.0) -> Row:
    """A row with the paper's figure."""
    return Row(name, (Figure("CLIP", percent / 100, error / 100),))


@pytest.mark.parametrize(
    ("worse", "better", "order"),
    [
        (range(2), range(8), "as the paper"),
        (range(5), range(2, 8), "as the paper, within the error"),
        (range(2, 8), range(5), "against the paper, within the error"),
        (range(5), range(5), "against the paper, within the error"),
        (range(8), range(2), "against the paper"),
    ],
)
def test_rows_that_the_paper_tells_apart_are_compared_pair_by_pair(worse: range, better: range, order: str) -> None:
    found = tables.agreement((row("bad", 40), row("good", 60)), by_variant(entries("bad", worse) + entries("good", better)), "j")
    assert found == {name: [["good", "bad"]] if name == order else [] for name in tables.ORDERS}


def test_rows_that_the_paper_does_not_tell_apart_are_not_compared() -> None:
    groups = by_variant(entries("one", range(1)) + entries("other", range(9)))
    found = tables.agreement((row("one", 40, 4), row("other", 43, 4), Row("true pictures", row("", 90).paper, reference=True)), groups, "j")
    assert not any(found.values())


def test_figures_and_their_plot(tmp_path: Path) -> None:
    report = Report("t", tuple(entries("bad", range(3)) + entries("good", range(8))), (row("bad", 40), Row("good")), ("j",))
    said = tables.figures(report, "j")
    assert [one["R-Precision"]["mean"] for one in said] == [0.3, 0.8]
    assert [one["paper"] for one in said] == [{"mean": 0.4, "error": 0.01}, None]
    tables.plot(json.loads(json.dumps({"rows": said})), tmp_path / "plot.png")
    assert (tmp_path / "plot.png").read_bytes()[:4] == b"\x89PNG"


def test_pictures_are_a_line_for_each_row_and_white_where_there_is_none(tmp_path: Path) -> None:
    (tmp_path / "red.webp").write_bytes(webp(np.full((8, 8, 3), (255, 0, 0), np.uint8)))
    shown = [replace(entry, files={"poster.webp": "red.webp"}) for entry in entries("good", range(3))]
    rows = (Row("true pictures", reference=True), row("bad", 40), row("good", 60))
    seen = tables.pictures(Report("t", (*entries("true pictures", range(3)), *entries("bad", range(3)), *shown), rows, ("j",)), tmp_path)
    side = tables.SIDE
    assert seen.shape == (2 * side + 2, 10 * (side + 2) - 2, 3) and (seen[:side] == 255).all()
    assert (abs(seen[side + 2 :, ::2].astype(int) - (255, 0, 0)).max(axis=-1).mean(axis=0)[: side // 2] < 8).all()

"""The report of a sweep: one page in the folder of the dreams, beside the paper's figures where there are any."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dreamfields_core.reporting.contract import Entry, Figure, Night, Report, Row
from flows.sweep_record import TRUTHS
from flows.tables import Table, TableError, load_table
from flows.tables.types import Figure as TableFigure
from flows.tables.types import Size
from storage.steps import StepRecord


def page_of(record: StepRecord, out: Path) -> Path:
    """Where the page of a sweep stands."""
    return out / f"{record.values['name']}.html"


def report_of(record: StepRecord, found: Sequence[Entry], *, night: Night | None = None) -> Report:
    """What the page is made of."""
    said = record.values
    table = _table(said["table"])
    facts = {"captions": said["source"], "preset": said["preset"], "date": record.created, "code": record.code_version}
    judges = tuple(dict.fromkeys(judge for entry in found for judge in (entry.result or {}).get("scores", {}))) or tuple(said["judges"])
    size: Size = "draft" if said["preset"] == "draft" else "paper"
    truth = table.references[0].paper if table and table.references else ()
    rows: tuple[Row, ...] = (Row(TRUTHS, _figures(truth), reference=True),)
    rows += tuple(Row(row.name, _figures(row.paper)) for row in table.rows_at(size)) if table else ()
    named = {entry.variant for entry in found}
    return Report(
        title=table.title if table else f"Sweep {said['name']}",
        entries=tuple(found),
        rows=tuple(row for row in rows if row.name in named or (row.reference and row.paper)),
        judges=judges,
        night=night,
        facts=facts,
    )


def _table(name: str | None) -> Table | None:
    """The table as it is today, None where it has gone."""
    try:
        return load_table(name) if name else None
    except TableError:
        return None


def _figures(paper: Sequence[TableFigure]) -> tuple[Figure, ...]:
    """The paper's figures under its own names of the judges: the page has a column of its own for each."""
    return tuple(Figure(said.column, said.percent / 100, None if said.error is None else said.error / 100, said.overfit) for said in paper)

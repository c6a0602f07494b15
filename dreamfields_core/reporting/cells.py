"""The table of a sweep as values: which columns there are and what stands in them, for the page and for the conductor alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dreamfields_core.judging.tables import Estimate
from dreamfields_core.reporting.contract import POOLS, SOURCES, Entry, Pool, Report
from dreamfields_core.reporting.statistics import all_rows, by_variant, improvement, precision, retrieval, similarity

MINUS = "−"


@dataclass(frozen=True)
class Cell:
    """value: sorts it. text: the mean. error: its standard error, as shown. best: of its column. own: judged by the model that guided."""

    value: float
    text: str
    error: str = ""
    best: bool = False
    own: bool = False


@dataclass(frozen=True)
class Column:
    """Stands under a group's heading, which may be empty."""

    group: str
    name: str


@dataclass(frozen=True)
class Line:
    """A row: its variant, objects and failures, a cell or None for each column, and what a drawing of it needs."""

    variant: str
    objects: int
    failures: int
    cells: tuple[Cell | None, ...]
    reference: bool
    ours: Estimate | None
    paper: Estimate | None


@dataclass(frozen=True)
class ResultTable:
    """All variants as one judge sees them."""

    judge: str
    columns: tuple[Column, ...]
    lines: tuple[Line, ...]


def result_table(report: Report, judge: str) -> ResultTable:
    """R-Precision of field and mesh in each pool, the fields' difference to the first row that was dreamed, cosine, the paper."""
    groups, rows = by_variant(report.entries), all_rows(report)
    base = next((groups[row.name] for row in rows if row.name in groups and not row.reference), [])
    pools = [pool for pool in POOLS if any(precision(group, judge, pool, source) for group in groups.values() for source in SOURCES)]
    papers = tuple(dict.fromkeys(figure.judge for row in report.rows for figure in row.paper))
    columns = [
        *(column for pool in pools for column in _pool_columns(report.entries, judge, pool)),
        Column("", "Cosine"),
        *(Column("Paper", name) for name in papers),
    ]
    lines = []
    for row in rows:
        group = groups.get(row.name, [])
        own = any(_guided_by(entry, judge) for entry in group)
        figures = {figure.judge: figure for figure in row.paper}
        cells = [
            *(cell for pool in pools for cell in _pool_cells(group, base, judge, pool, own=own, reference=row.reference)),
            _cosine(similarity(group, judge, "field")),
            *(
                _share(_stated(figures[name].mean, figures[name].error), own=figures[name].own) if name in figures else None
                for name in papers
            ),
        ]
        first = row.paper[0] if row.paper else None
        failures = sum(entry.result is None for entry in group)
        ours = precision(group, judge, pools[0], "field") if pools else None
        paper = _stated(first.mean, first.error) if first else None
        lines.append(Line(row.name, len(group) - failures, failures, tuple(cells), row.reference, ours, paper))
    # A sweep that only scored has no meshes to speak of.
    shown = [place for place, column in enumerate(columns) if column.name != "Mesh" or any(line.cells[place] for line in lines)]
    lines = [replace(line, cells=tuple(line.cells[place] for place in shown)) for line in _with_best(lines, columns)]
    return ResultTable(judge, tuple(columns[place] for place in shown), tuple(lines))


def plain_rows(table: ResultTable) -> list[dict[str, str]]:
    """The same as texts by heading, for a table that knows no markup."""
    return [
        {"variant": line.variant, "objects": str(line.objects), "failed": str(line.failures)}
        | {
            f"{column.group}: {column.name}" if column.group else column.name: f"{cell.text} {cell.error}".strip() if cell else ""
            for column, cell in zip(table.columns, line.cells)
        }
        for line in table.lines
    ]


def percent(share: float, *, signed: bool = False) -> str:
    """A fraction in percent, one decimal, with a proper minus."""
    text = f"{100 * share:+.1f}" if signed else f"{100 * share:.1f}"
    return "0.0" if float(text) == 0 else text.replace("-", MINUS)


def _pool_columns(entries: Sequence[Entry], judge: str, pool: Pool) -> tuple[Column, Column, Column]:
    sizes = {said["pool"] for entry in entries for source in SOURCES if (said := retrieval(entry, judge, pool, source))}
    count = str(min(sizes)) if len(sizes) == 1 else f"{min(sizes)} to {max(sizes)}"
    group = f"among {count} captions" if pool == "random" else f"among {count} of the same colours"
    return Column(group, "Field"), Column(group, "Mesh"), Column(group, "Difference")


def _pool_cells(
    group: Sequence[Entry], base: Sequence[Entry], judge: str, pool: Pool, *, own: bool, reference: bool
) -> tuple[Cell | None, Cell | None, Cell | None]:
    field, mesh = (_share(precision(group, judge, pool, source), own=own) for source in SOURCES)
    moved = improvement(group, base, judge, pool, "field") if group is not base and not reference else None
    return field, mesh, Cell(moved.mean, percent(moved.mean, signed=True), _error(moved)) if moved else None


def _share(estimate: Estimate | None, *, own: bool) -> Cell | None:
    return Cell(estimate.mean, percent(estimate.mean), _error(estimate), own=own) if estimate else None


def _cosine(estimate: Estimate | None) -> Cell | None:
    if estimate is None:
        return None
    error = "" if math.isnan(estimate.error) else f"± {estimate.error:.3f}"
    return Cell(estimate.mean, f"{estimate.mean:.3f}".replace("-", MINUS), error)


def _error(estimate: Estimate) -> str:
    return "" if math.isnan(estimate.error) else f"± {100 * estimate.error:.1f}"


def _stated(mean: float, error: float | None) -> Estimate:
    return Estimate(mean, math.nan if error is None else error, 0, 0)


def _guided_by(entry: Entry, judge: str) -> bool:
    """Whether the judge's weights had guided (the diagonal of the paper's table 3)."""
    encoders = (entry.result or {}).get("encoders") or {}
    guide, first = (encoders.get(role) or {} for role in ("guidance", "judge"))
    return guide.get("name") == judge or bool(encoders.get("same_model") and first.get("name") == judge)


def _with_best(lines: Sequence[Line], columns: Sequence[Column]) -> list[Line]:
    """The best dreams of each column of R-Precision are marked, over-fitted ones aside, where there is anything to compare."""
    marked = [list(line.cells) for line in lines]
    dreamed = [cells for cells, line in zip(marked, lines) if not line.reference]
    for place, column in enumerate(columns):
        if column.name not in ("Field", "Mesh") and column.group != "Paper":
            continue
        rivals = [(cells, cell) for cells in dreamed if (cell := cells[place]) and not cell.own]
        best = max((cell.value for _, cell in rivals), default=math.nan)
        for cells, cell in rivals if len(rivals) > 1 else ():
            if cell.value == best:
                cells[place] = replace(cell, best=True)
    return [replace(line, cells=tuple(cells)) for line, cells in zip(lines, marked)]

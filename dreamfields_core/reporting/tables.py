"""The tables of the page: results by judge, what changed since the last night, failures."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from dreamfields_core.reporting.cells import Cell, Line, ResultTable, percent
from dreamfields_core.reporting.contract import Change, Entry, Night
from dreamfields_core.reporting.markup import Content, Markup, element
from dreamfields_core.reporting.plots import dots


def results(table: ResultTable) -> Markup:
    """Every variant as one judge sees it, best marked, the paper beside it."""
    fixed = ["Variant", "Objects"]
    chart = element("th", "R-Precision, 0 to 100 %", rowspan=2, scope="col", class_="chart")
    names = [column.name for column in table.columns]
    top = [element("th", _sort_button(name), rowspan=2, scope="col", data_column=place) for place, name in enumerate(fixed)]
    at = 0
    for group, columns in groupby(table.columns, key=lambda column: column.group):
        width = len(list(columns))
        if group:
            top.append(element("th", group, colspan=width, scope="colgroup"))
        else:
            top += [_head(names[at + i], len(fixed) + 1 + at + i, rowspan=2) for i in range(width)]
        at += width
    second = [_head(column.name, len(fixed) + 1 + place) for place, column in enumerate(table.columns) if column.group]
    head = element("thead", element("tr", top[0], top[1], chart, *top[2:]), element("tr", *second))
    body = element("tbody", *(_line(line) for line in table.lines))
    caption = element("caption", "R-Precision in percent, by ", element("b", table.judge))
    return _scrolling(element("table", caption, head, body, class_="results"), f"Results by {table.judge}")


def changes(night: Night) -> Markup:
    """Every comparison with the last night, those that fell first and flagged in words."""
    fallen = sum(change.fell for change in night.changes)
    count = f"{fallen} of {len(night.changes)} comparisons fell" if fallen else f"None of {len(night.changes)} comparisons fell"
    said = element("p", f"{count} by more than the standard error since ", element("bdi", night.since), ".")
    titles = ("", "Variant", "Judge", "Pool", "Of the", "Objects", "Before", "Now", "Change")
    head = element("thead", element("tr", *(_head(title, place) for place, title in enumerate(titles))))
    ordered = sorted(night.changes, key=lambda change: not change.fell)
    table = element("table", head, element("tbody", *map(_change, ordered)), class_="night")
    return element("div", said, _scrolling(table, "Changes since the last night"))


def failures(entries: Sequence[Entry]) -> Markup:
    """Those without an object, with the sentence that says why."""
    rows = [
        element(
            "tr",
            element("th", element("bdi", entry.caption), scope="row"),
            element("td", entry.variant),
            element("td", entry.seed, class_="number", data_value=entry.seed),
            element("td", element("bdi", entry.error or "no reason was recorded")),
        )
        for entry in entries
    ]
    head = element("thead", element("tr", *(_head(title, place) for place, title in enumerate(("Caption", "Variant", "Seed", "Why")))))
    return _scrolling(element("table", head, element("tbody", *rows), class_="failures"), "Failures")


def _line(line: Line) -> Markup:
    count: list[Content] = [line.objects or "–"]
    if line.failures:
        count.append(element("small", f" + {line.failures} failed", class_="bad"))
    drawn = []
    if line.paper:
        drawn.append((line.paper.mean, line.paper.error, "paper"))
    if line.ours:
        drawn.append((line.ours.mean, line.ours.error, "ours"))
    return element(
        "tr",
        element("th", element("bdi", line.variant), scope="row"),
        element("td", *count, class_="number", data_value=line.objects),
        element("td", dots(drawn) if drawn else None, class_="chart"),
        *map(_cell, line.cells),
    )


def _cell(cell: Cell | None) -> Markup:
    if cell is None:
        return element("td", "–", class_="number none")
    shown = element("b", cell.text) if cell.best else element("i", "(", cell.text, ")") if cell.own else cell.text
    error = element("small", " ", cell.error) if cell.error else None
    return element("td", shown, error, class_="number", data_value=f"{cell.value:.6f}")


def _change(change: Change) -> Markup:
    texts = (change.variant, change.judge, change.pool, change.source)
    moved, error = change.now - change.before, f" ± {100 * change.error:.1f}" if change.error == change.error else ""
    return element(
        "tr",
        element("td", element("span", "▼ fell", class_="bad") if change.fell else None, data_value=int(change.fell)),
        *(element("td", text) for text in texts),
        element("td", change.objects, class_="number", data_value=change.objects),
        *(element("td", percent(share), class_="number", data_value=f"{share:.6f}") for share in (change.before, change.now)),
        element("td", percent(moved, signed=True), element("small", error), class_="number", data_value=f"{moved:.6f}"),
        class_="fell" if change.fell else None,
    )


def _head(title: str, column: int, *, rowspan: int | None = None) -> Markup:
    return element("th", _sort_button(title) if title else None, scope="col", data_column=column, rowspan=rowspan)


def _sort_button(title: str) -> Markup:
    return element("button", title, type="button")


def _scrolling(table: Markup, label: str) -> Markup:
    """Wide tables scroll by themselves, by keyboard too."""
    return element("div", table, class_="scrolling", tabindex=0, role="region", aria_label=label)

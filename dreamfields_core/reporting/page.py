"""A report as one page that needs nothing but the pictures beside it: no server, no library, no request that leaves its folder.

The policy in its head lets pictures in and nothing else, and runs the one script whose digest it states, so that even a fault in the
escaping could not start another.
"""

from __future__ import annotations

import base64
import hashlib

from dreamfields_core.reporting.cells import result_table
from dreamfields_core.reporting.contract import Report
from dreamfields_core.reporting.curves import QUANTITIES, mean_curve
from dreamfields_core.reporting.gallery import gallery
from dreamfields_core.reporting.markup import Content, Markup, element, join
from dreamfields_core.reporting.plots import extent, plot
from dreamfields_core.reporting.script import SCRIPT
from dreamfields_core.reporting.statistics import all_rows, by_variant
from dreamfields_core.reporting.style import STYLE
from dreamfields_core.reporting.tables import changes, failures, results


def render_report(report: Report) -> str:
    """The page as HTML; the same report gives the same text."""
    sections = _sections(report)
    body = element(
        "body",
        element("a", "To the objects", href="#objects", class_="skip") if report.entries else None,
        element("header", element("h1", report.title, dir="auto"), _facts(report), _contents(sections)),
        element("main", *(element("section", element("h2", title), content, id=name) for name, title, content in sections)),
        element("script", Markup(SCRIPT)),
    )
    return f'<!doctype html>\n<html lang="en">{_head(report.title)}{body}</html>\n'


def _head(title: str) -> Markup:
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    policy = f"default-src 'none'; img-src 'self' file: data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; base-uri 'none'"
    return element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=policy),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("link", rel="icon", href="data:,"),
        element("style", Markup(STYLE)),
    )


def _sections(report: Report) -> list[tuple[str, str, Markup]]:
    """Name, title and content of those that have anything to say."""
    failed = [entry for entry in report.entries if entry.result is None]
    curves = _curves(report)
    found: list[tuple[str, str, Markup]] = []
    if report.judges:
        found.append(("results", "Results", _results(report)))
    if report.night is not None:
        found.append(("night", "Since the last night", changes(report.night)))
    if curves:
        found.append(("curves", "Learning curves", curves))
    if failed:
        found.append(("failures", "Failures", failures(failed)))
    found.append(("gallery", "Objects", gallery(report.entries, report.judges)))
    return found


def _facts(report: Report) -> Markup:
    references = {row.name for row in report.rows if row.reference}
    there = [entry.result is not None for entry in report.entries if entry.variant not in references]
    told = {**report.facts, "objects": str(sum(there)), "failures": str(len(there) - sum(there))}
    return element("dl", *(element("div", element("dt", name), element("dd", value)) for name, value in told.items()), class_="facts")


def _contents(sections: list[tuple[str, str, Markup]]) -> Markup:
    return element("nav", *(element("a", title, href=f"#{name}") for name, title, _ in sections), aria_label="On this page")


def _results(report: Report) -> Markup:
    tables = [results(result_table(report, judge)) for judge in report.judges]
    paper = any(row.paper for row in report.rows)
    key: list[Content] = [element("span", class_="key"), "here, from the field"]
    if paper:
        key += [" ", element("span", class_="key paper"), "the paper, by its first judge"]
    notes = (
        "R-Precision is the share of objects whose caption the judge, who sees one held-out view, picks out of all. ± is the standard "
        "error of the mean over captions: seeds of one caption count as one cluster. Differences are to the first row that was dreamed, "
        "over the captions and seeds that both have. Failed dreams are not counted. Bold is the best of a column; (italics) are judged "
        "by the model that guided."
    )
    theirs = " The paper's errors take seeds of one caption as independent." if paper else ""
    return join([element("p", *key, class_="quiet key-line"), *tables, element("p", notes + theirs, class_="quiet")])


def _curves(report: Report) -> Markup | None:
    """A line of plots for each variant, each quantity on one scale for all of them."""
    groups = by_variant(report.entries)
    bands = {
        name: {quantity: mean_curve(groups.get(name, ()), quantity) for quantity in QUANTITIES}
        for name in (row.name for row in all_rows(report))
    }
    known = {quantity: [band for found in bands.values() if (band := found[quantity])] for quantity in QUANTITIES}
    scales = {quantity: (0.0, 1.0) if quantity == "correct" else extent(found) for quantity, found in known.items() if found}
    if not scales:
        return None
    lines: list[Content] = [
        element(
            "p",
            "Means over objects, shaded the standard error; one that ended earlier stays as it was left. One scale for all variants.",
            class_="quiet",
        )
    ]
    for name, found in bands.items():
        figures = [
            element("figure", element("figcaption", title), plot(band, f"{title} by step, {name}", values=scales[quantity]))
            for quantity, title in QUANTITIES.items()
            if (band := found[quantity])
        ]
        if figures:
            lines += [element("h3", element("bdi", name)), element("div", *figures, class_="curves")]
    return join(lines)

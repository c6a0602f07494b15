"""A table of the paper, dreamed with the embedded models at draft size, and how far it agrees with the paper.

    python -m benchmarks.tables table3 --out dreams        the sweep of that table, as far as it is not there; then its figures and pictures

The sweep is that of `dreamfields sweep --table table3 --score-only`, so it goes on where that one was stopped. What can agree is the
order of the rows: for every two rows whose figures in the paper lie further apart than their standard errors together, ours do so too,
or lie the other way round, or within the error of their paired difference.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from itertools import combinations
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.drawing import sheet
from benchmarks.record import RESULTS, Result, leave
from dreamfields_core.judging.tables import Estimate
from dreamfields_core.rendering.pictures import webp
from dreamfields_core.reporting.contract import Entry, Report, Row
from dreamfields_core.reporting.pictures import montage, still
from dreamfields_core.reporting.statistics import by_variant, improvement, precision, retrieval, similarity
from flows.order import sweep_key
from flows.report import POSTER
from flows.sweep_plain import sweep_plainly
from flows.sweep_plan import Plan, plan_sweep
from flows.sweep_record import entries
from flows.sweep_report import report_of
from storage.steps import find_record
from storage.store import open_store
from tasks.encoders import card

ORDERS = ("as the paper", "as the paper, within the error", "against the paper, within the error", "against the paper")
"""What becomes of two rows that the paper tells apart."""
SIDE = 64
"""Pixels of an object's picture."""


def figures(report: Report, judge: str) -> list[Result]:
    """A row each: R-Precision in both pools, the mean cosine, the paper's figure."""
    groups = by_variant(report.entries)
    return [
        {
            "row": row.name,
            "objects": len(groups[row.name]),
            "R-Precision": _stated(precision(groups[row.name], judge, "random", "field")),
            "R-Precision, hard pool": _stated(precision(groups[row.name], judge, "hard", "field")),
            "cosine": _stated(similarity(groups[row.name], judge, "field")),
            "paper": {"mean": row.paper[0].mean, "error": row.paper[0].error} if row.paper else None,
        }
        for row in report.rows
    ]


def agreement(rows: Sequence[Row], groups: dict[str, list[Entry]], judge: str) -> dict[str, list[list[str]]]:
    """The pairs of rows that the paper tells apart, better one first, by `ORDERS`."""
    found: dict[str, list[list[str]]] = {order: [] for order in ORDERS}
    for one, other in combinations([row for row in rows if row.paper and not row.reference], 2):
        apart = one.paper[0].mean - other.paper[0].mean
        if abs(apart) <= hypot(one.paper[0].error or 0.0, other.paper[0].error or 0.0):
            continue
        better, worse = (one.name, other.name) if apart > 0 else (other.name, one.name)
        ours = improvement(groups[better], groups[worse], judge, "random", "field")
        if ours:
            order = "as the paper" if ours.mean > 0 else "against the paper"
            found[order if abs(ours.mean) > ours.error else f"{order}, within the error"].append([better, worse])
    return found


def result_of(plan: Plan, report: Report) -> Result:
    """The figures, the agreement and every object's ranks."""
    judge, groups = plan.judges[0], by_variant(report.entries)
    orders = agreement(report.rows, groups, judge)
    config = next(cell.order.config for cell in plan.cells if cell.order)
    return {
        "headline": {"objects": len(plan.cells), **{order: len(pairs) for order, pairs in orders.items()}},
        "guide": card(config.guidance.name).digest,
        "judge": card(judge).digest,
        "rows": figures(report, judge),
        "pairs": orders,
        "objects": [_object(entry, judge) for entry in report.entries],
    }


def plot(result: Result, path: Path) -> None:
    """Ours and the paper's R-Precision, a line a row."""
    rows = list(reversed(result["rows"]))
    with sheet(path) as (panel,):
        for name, shift, key in (("here", 0.12, "R-Precision"), ("the paper", -0.12, "paper")):
            said = [(place + shift, row[key]) for place, row in enumerate(rows) if row[key]]
            means, errors = ([100 * (figure[part] or 0.0) for _, figure in said] for part in ("mean", "error"))
            panel.errorbar(means, [place for place, _ in said], xerr=errors, fmt="o", capsize=3, label=name)
        panel.set_yticks(range(len(rows)), [row["row"] for row in rows])
        panel.set_xlim(0, 100)
        panel.set_xlabel("R-Precision, %, with its standard error")


def pictures(report: Report, out: Path) -> np.ndarray:
    """What the judge saw first of every object, uint8 [H, W, 3]: a line for each row, captions from left to right, seed after seed.

    out: the folder that the entries' files are relative to.
    """
    groups = by_variant(report.entries)
    lines = [groups[row.name] for row in report.rows if not row.reference]
    return montage([_seen(entry, out) for line in lines for entry in line], columns=max(map(len, lines)), side=SIDE, gap=2)


def _seen(entry: Entry, out: Path) -> np.ndarray:
    return still((out / entry.files[POSTER]).read_bytes()) if POSTER in entry.files else np.full((SIDE, SIDE, 3), 255, np.uint8)


def _object(entry: Entry, judge: str) -> Result:
    said: dict[str, Any] = {pool: retrieval(entry, judge, pool, "field") or {} for pool in ("random", "hard")}
    ranks = {f"rank, {pool}": found.get("rank") for pool, found in said.items()}
    return {"row": entry.variant, "caption": entry.caption, "seed": entry.seed, "error": entry.error, **ranks}


def _stated(estimate: Estimate | None) -> Result | None:
    return {"mean": round(estimate.mean, 4), "error": round(estimate.error, 4)} if estimate else None


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", help="a name in flows/tables")
    parser.add_argument("--out", type=Path, default=Path("dreams"), help="folder of the store and of the page")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the JSON, its plot and the pictures")
    arguments = parser.parse_args()
    plan = plan_sweep(table=arguments.table, out=arguments.out, score_only=True)
    if sweep_plainly(plan):
        raise SystemExit("expected every object of the table, got some that could not be dreamed: see above, then run it again")
    store = open_store(plan.store)
    record = find_record(store, "sweep", sweep_key(plan.name))
    assert record is not None  # the sweep has just kept it
    report = report_of(record, list(entries(record, store, plan.out)))
    result = result_of(plan, report)
    command = f"python -m benchmarks.tables {arguments.table}"
    path = leave(arguments.table, result, command=command, folder=arguments.results)
    plot(json.loads(path.read_text(encoding="utf-8")), path.with_suffix(".png"))
    path.with_suffix(".webp").write_bytes(webp(pictures(report, plan.out)))
    print(json.dumps({"headline": result["headline"], "rows": result["rows"]}, indent=1))


if __name__ == "__main__":
    main()

"""Every night: what is stored is judged again, nothing is dreamed, and what has fallen since the last night is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from prefect import flow
from prefect.artifacts import create_markdown_artifact
from prefect.logging import get_run_logger

from dreamfields_core.config import DreamConfig
from flows.dream import ByPrefect
from flows.night import Comparison, Scores, judge_again, judged, remember
from flows.order import OrderError, address_of
from flows.report import show_report, write_page
from flows.sweep_record import entries, members, sweeps
from flows.sweep_report import page_of, report_of
from flows.sweep_run import sentence
from storage.contract import Store
from storage.steps import StepRecord
from storage.store import open_store
from tasks.encoders import card
from tasks.step import Place


@flow(name="nightly-eval", persist_result=False)
def nightly_eval(
    store: str | None = None, out: str = "dreams", sweep: str | None = None, judges: list[str] | None = None
) -> dict[str, Any]:
    """Judge the objects of every sweep again, compare with the last night, and renew the reports.

    Args:
      store: folder or s3://bucket/prefix; by default $DREAMFIELDS_STORE, else the folder `store` in `out`.
      out: folder of the reports.
      sweep: the name of one; by default all that the store has.
      judges: image-text models beside those that each sweep has anyway.

    Returns:
      By sweep: objects judged, those that could not be with the reason, what fell by more than its standard error, objects that are no
      longer recognised, and where the report is.
    """
    place = open_store(address_of(store, Path(out)))
    for name in judges or ():
        card(name)
    found = [record for record in sweeps(place) if sweep in (None, record.values["name"])]
    if not found:
        raise OrderError(f"expected {f'a sweep {sweep}' if sweep else 'a sweep'} in {place.url}, got none: run coco-sweep first")
    return {record.values["name"]: evaluate(record, place, Path(out), judges or []) for record in found}


def evaluate(record: StepRecord, store: Store, out: Path, more: list[str]) -> dict[str, Any]:
    """One sweep: judged, compared, and its report renewed."""
    judges, log = list(dict.fromkeys([*record.values["judges"], *more])), get_run_logger()
    found: dict[str, Scores] = {}
    gone: dict[str, str] = {}
    for member in members(record):
        if member.key is None:
            continue
        try:
            found[member.key] = judge_again(store, member.key, judges, lambda config: _conductor(store, config))
        except Exception as error:  # one object's fault keeps no other from being judged
            gone[f"{member.caption} ({member.variant}, seed {member.seed})"] = sentence(error)
    tonight = judged(list(entries(record, store, out)), found, members(record))
    compared = remember(store, record.values["name"], tonight, judges)
    report = report_of(record, tonight, night=compared.night)
    page = write_page(report, page_of(record, out))
    for text in (*compared.fell, *compared.lost):
        log.warning("fell since the last night: %s", text)
    _show(record, compared, gone)
    show_report(report, out)
    return {"objects": len(found), "gone": gone, "fell": compared.fell, "lost": list(compared.lost), "report": str(page)}


def _conductor(store: Store, config: DreamConfig) -> ByPrefect:
    return ByPrefect(Place(store), config)


def _show(record: StepRecord, compared: Comparison, gone: dict[str, str]) -> None:
    """What a person should look at, on the run's page."""
    since = compared.night.since if compared.night else None
    lines = [f"# {record.values['name']}", "", f"Compared with {since}." if since else "The first night: nothing to compare with."]
    parts = {"Fell by more than its standard error": compared.fell, "No longer recognised": list(compared.lost)}
    parts["Could not be judged"] = [f"{name}: {why}" for name, why in gone.items()]
    for title, items in parts.items():
        lines += ["", f"## {title}", "", *([f"- {item}" for item in items] or ["Nothing."])]
    create_markdown_artifact("\n".join(lines), key="night", description=record.values["name"])

"""Captions x seeds x variants, each an object of the one recipe, conducted by Prefect: resumed by being run again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from prefect import flow
from prefect.logging import get_run_logger
from prefect.runtime import flow_run
from pydantic import Field

from flows.dream import Preset, Seed, Setting, dream
from flows.report import show_report, write_page
from flows.sweep_dask import over_dask
from flows.sweep_oracle import oracle_of
from flows.sweep_plan import Cell, Plan, plan_sweep
from flows.sweep_pool import through_pool
from flows.sweep_record import entries, keep_sweep, missing
from flows.sweep_report import page_of, report_of
from flows.sweep_run import run_cells
from storage.store import open_store
from tasks.step import Place

Source = Annotated[str, Field(min_length=1, description="coco, embedded:COUNT[:SEED], coco:captions_*.json, or a .txt, .csv or .json file")]
Through = Literal["here", "pool", "dask"]


class SweepFailed(RuntimeError):
    """Not one object of a sweep could be dreamed; the text has the first reason."""


def _run_name() -> str:
    asked = flow_run.parameters
    return " ".join(str(asked[name]) for name in ("captions", "table") if asked.get(name)) or "coco-sweep"


@flow(name="coco-sweep", flow_run_name=_run_name, persist_result=False)
def coco_sweep(
    captions: Source | None = None,
    table: str | None = None,
    variants: list[str] | None = None,
    seeds: list[Seed] | None = None,
    preset: Preset = "draft",
    guidance: str | None = None,
    judge: str | None = None,
    settings: list[Setting] | None = None,
    score_only: bool = False,
    store: str | None = None,
    out: str = "dreams",
    through: Through = "here",
    workers: Annotated[int, Field(ge=1, le=1024)] = 2,
    scheduler: Annotated[str, Field(pattern=r"^(tcp|tls|ucx)://")] | None = None,
) -> dict[str, Any]:
    """Dream every caption with every seed in every variant; what the store has is not even scheduled.

    Args:
      captions: where they come from; by default the table's own.
      table: a table of the paper, whose rows are the variants.
      variants: some of its rows; all of them by default.
      seeds: by default the table's own, else 0.
      preset: draft, or the paper's low, medium and high.
      guidance: the image-text model to optimise with.
      judge: the image-text model that scores; by default those of the table's columns.
      settings: changes to the preset for all variants.
      score_only: neither pictures nor meshes, only fields and their scores, as the paper's tables need them.
      store: folder or s3://bucket/prefix; by default $DREAMFIELDS_STORE, else a folder `store` beside the dreams.
      out: folder of the dreams and of the report.
      through: here (one object after the other on this worker's device), pool (each a run of dream/dream, by the workers of
        several machines), or dask.
      workers: processes on this machine, for dask without a scheduler.
      scheduler: address of a Dask cluster.

    Returns:
      The sweep's name, how many objects there are, were there already, were dreamed and failed, and where the report is.
    """
    plan = plan_sweep(
        captions,
        table=table,
        variants=variants or (),
        seeds=seeds or (),
        preset=preset,
        guidance=guidance,
        judge=judge,
        settings=settings or (),
        store=store,
        out=Path(out),
        score_only=score_only,
    )
    place, log = open_store(plan.store), get_run_logger()
    keep_sweep(plan, place)
    waiting = missing(plan, place)
    refused = [cell for cell in plan.cells if cell.error]
    there = len(plan.cells) - len(refused) - len(waiting)
    log.info("%s: %d objects, %d there already, %d to dream, %d refused", plan.name, len(plan.cells), there, len(waiting), len(refused))
    errors = _conductor(through, workers, scheduler)(plan, waiting) if waiting else {}
    truths = oracle_of(plan, Place(place, lambda event: log.info("%s", event.get("text"))))
    record = keep_sweep(plan, place, errors, truths)
    report = report_of(record, list(entries(record, place, plan.out)))
    page = write_page(report, page_of(record, plan.out))
    show_report(report, plan.out)
    if waiting and len(errors) == len(waiting) and not there:
        raise SweepFailed(f"expected at least one object, but each of {len(errors)} failed, the first so: {next(iter(errors.values()))}")
    done = len(waiting) - len(errors)
    return {"name": plan.name, "objects": len(plan.cells), "cached": there, "dreamed": done, "failed": errors, "report": str(page)}


def _conductor(through: Through, workers: int, scheduler: str | None) -> Callable[[Plan, Sequence[Cell]], dict[str, str]]:
    """Who has the objects made: (plan, cells) -> by key, the sentences of those that failed."""
    if through == "pool":
        return through_pool
    if through == "dask":
        return lambda plan, cells: over_dask(cells, workers=workers, scheduler=scheduler)
    return one_by_one


def one_by_one(plan: Plan, cells: Sequence[Cell]) -> dict[str, str]:
    """On this process's main thread, so that a cancel or a signal reaches the one that is under way, which saves."""
    errors: dict[str, str] = {}

    def failed(cell: Cell, text: str) -> None:
        get_run_logger().error("%s: %s", cell.name, text)
        errors[cell.key or ""] = text

    run_cells(cells, lambda cell: dream.with_options(flow_run_name=cell.run_name)(**cell.parameters), failed)
    return errors

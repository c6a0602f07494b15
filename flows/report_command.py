"""The command that writes a stored sweep's report anew, wherever its page shall stand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.order import OrderError, address_of
from storage.contract import Store
from storage.steps import StepRecord

StoreOption = Annotated[str | None, typer.Option(help="Folder or s3://bucket/prefix; $DREAMFIELDS_STORE, else dreams/store.")]


def report(
    sweep: Annotated[str | None, typer.Argument(help="Name of a sweep, or the beginning of it; by default the newest.")] = None,
    to: Annotated[Path, typer.Option(help="Folder that gets the page and what it shows; what is there is not copied again.")] = Path(
        "dreams"
    ),
    store: StoreOption = None,
) -> None:
    """Write the report of a stored sweep: one page that needs no server, with its pictures and meshes beside it."""
    from flows.report import write_page
    from flows.sweep_record import entries, sweeps
    from flows.sweep_report import page_of, report_of
    from storage.store import open_store

    place = open_store(address_of(store, Path("dreams")))
    record = chosen(sweeps(place), sweep, place)
    typer.echo(write_page(report_of(record, list(entries(record, place, to))), page_of(record, to)))


def chosen(known: list[StepRecord], name: str | None, store: Store) -> StepRecord:
    """The sweep of that name, else the only one whose name begins so, else, without a name, the first. Raises: OrderError."""
    names = [record.values["name"] for record in known]
    fitting = known[:1] if name is None else [record for record in known if record.values["name"] == name]
    if name and not fitting:
        fitting = [record for record in known if record.values["name"].startswith(name)]
    if len(fitting) != 1:
        there = ", ".join(names) or "none at all: run `dreamfields sweep` first, or name its store with --store"
        raise OrderError(f"expected one sweep{f' named {name}' if name else ''} in {store.url}, found {len(fitting)}; there are {there}")
    return fitting[0]


def register(app: typer.Typer) -> None:
    """Give the command to the command line."""
    app.command(epilog="Example: dreamfields report coco-table3 --store s3://studio/dreams --to report")(report)

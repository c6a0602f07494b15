"""Reading a table's file, and refusing one that could not be dreamt."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dreamfields_core.captions import CaptionError, check
from dreamfields_core.config import ConfigError
from flows.tables.types import SIZES, Column, Figure, Reference, Row, Size, Table

NAMED = re.compile(r"coco|embedded:[1-9]\d*(:\d+)?")
"""Sets of captions that a table names instead of holding them: the published ones, or so many of the embedded language (and their seed)."""


class TableError(ValueError):
    """A table that is not there or cannot be; its text is one sentence with the way out."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Figure(_Strict):
    percent: Annotated[float, Field(ge=0, le=100)]
    error: Annotated[float, Field(gt=0)] | None = None
    overfit: bool = False


class _Column(_Strict):
    name: str
    judges: dict[Size, str]


class _Row(_Strict):
    name: str
    overrides: tuple[str, ...] = ()
    paper: dict[str, _Figure] = {}
    own: dict[Size, tuple[str, ...]] = {}
    sizes: tuple[Size, ...] = SIZES


class _Reference(_Strict):
    name: str
    paper: dict[str, _Figure]


class _Table(_Strict):
    title: str
    source: str
    meaning: str
    presets: dict[Size, str]
    common: dict[Size, tuple[str, ...]] = {}
    columns: Annotated[tuple[_Column, ...], Field(min_length=1)]
    rows: Annotated[tuple[_Row, ...], Field(min_length=1)]
    references: tuple[_Reference, ...] = ()
    captions: dict[Size, tuple[str, ...] | str]
    seeds: dict[Size, Annotated[tuple[int, ...], Field(min_length=1)]]


def table_names() -> tuple[str, ...]:
    """The tables that there are, sorted."""
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in files("flows.tables").iterdir() if entry.name.endswith(".toml")))


def load_table(name: str) -> Table:
    """The table of that name.

    Raises:
      TableError: there is none, or what its file says could not be dreamt.
    """
    if name not in table_names():
        raise TableError(f'expected a table among {", ".join(table_names())}, got "{name}"')
    return parse_table(name, files("flows.tables").joinpath(f"{name}.toml").read_text(encoding="utf-8"))


def parse_table(name: str, text: str) -> Table:
    """A table from the text of its file. Raises: TableError."""
    try:
        read = _Table.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise TableError(f"table {name}: expected TOML, got something else ({error})") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(step) for step in first["loc"])
        raise TableError(f"table {name}: {place}: {first['msg'][:1].lower()}{first['msg'][1:]}") from None
    table = Table(
        name=name,
        title=read.title,
        source=read.source,
        meaning=read.meaning,
        presets=read.presets,
        common=read.common,
        columns=tuple(Column(column.name, column.judges) for column in read.columns),
        rows=tuple(Row(row.name, row.overrides, _figures(row.paper), row.own, row.sizes) for row in read.rows),
        references=tuple(Reference(line.name, _figures(line.paper)) for line in read.references),
        captions=read.captions,
        seeds=read.seeds,
    )
    _check(table)
    return table


def _figures(paper: Mapping[str, _Figure]) -> tuple[Figure, ...]:
    return tuple(Figure(column, figure.percent, figure.error, figure.overfit) for column, figure in paper.items())


def _check(table: Table) -> None:
    """Everything that can be checked without work, for both sizes."""
    for what, by_size in (("presets", table.presets), ("captions", table.captions), ("seeds", table.seeds)):
        _expect(set(by_size) == set(SIZES), table, f"expected {what} for {' and '.join(SIZES)}, got {', '.join(by_size) or 'none'}")
    columns = {column.name for column in table.columns}
    names = [row.name for row in table.rows]
    _expect(len(set(names)) == len(names), table, f"expected rows of different names, got {', '.join(names)}")
    lines: list[Row | Reference] = [*table.rows, *table.references]
    for line in lines:
        for figure in line.paper:
            _expect(figure.column in columns, table, f'row "{line.name}" has a figure in the unknown column "{figure.column}"')
    for size in SIZES:
        _check_captions(table, table.captions[size])
        _expect(bool(table.rows_at(size)) and bool(table.columns_at(size)), table, f"expected a row and a column at size {size}, got none")
        for row in table.rows_at(size):
            try:
                table.config(row, size)
            except ConfigError as error:
                raise TableError(f'table {table.name}: row "{row.name}" at size {size}: {error}') from None


def _check_captions(table: Table, captions: tuple[str, ...] | str) -> None:
    if isinstance(captions, str):
        _expect(NAMED.fullmatch(captions), table, f'expected captions in a list, coco or embedded:COUNT, got "{captions}"')
        return
    _expect(bool(captions), table, "expected at least one caption, got none")
    for caption in captions:
        try:
            check(caption)
        except CaptionError as error:
            raise TableError(f"table {table.name}: {error}") from None


def _expect(holds: Any, table: Table, otherwise: str) -> None:
    if not holds:
        raise TableError(f"table {table.name}: {otherwise}")

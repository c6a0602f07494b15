"""What a table of the paper is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from dreamfields_core.config import DreamConfig, override
from dreamfields_core.presets import preset

Size = Literal["paper", "draft"]
"""paper: published models at the paper's size. draft: the embedded models, minutes on two cores."""

SIZES: tuple[Size, ...] = ("paper", "draft")


@dataclass(frozen=True)
class Figure:
    """What the paper says of a row.

    column: the name of the column that it stands in.
    percent: R-Precision, in [0, 100], as printed or in more digits where the paper's source has them.
    error: its standard error, or None where the paper states none.
    overfit: the model that judged had guided; the figure says how far the object was fitted to it, not how good it is.
    """

    column: str
    percent: float
    error: float | None = None
    overfit: bool = False


@dataclass(frozen=True)
class Column:
    """name: the retrieval model as the paper calls it. judges: by size, `evaluate.judge` for this column; none where it is not measured."""

    name: str
    judges: Mapping[Size, str]


@dataclass(frozen=True)
class Row:
    """One variant.

    overrides: `part.key=value`, after the table's own.
    own: by size, further overrides that only this size needs, for instance the name of a model that is not at hand at the other.
    sizes: at which it is dreamt.
    paper: what the paper says of it; () where it gives no number.
    """

    name: str
    overrides: tuple[str, ...] = ()
    paper: tuple[Figure, ...] = ()
    own: Mapping[Size, tuple[str, ...]] = field(default_factory=dict)
    sizes: tuple[Size, ...] = SIZES

    def figure(self, column: str) -> Figure | None:
        """The paper's figure in that column."""
        return next((figure for figure in self.paper if figure.column == column), None)


@dataclass(frozen=True)
class Reference:
    """A line of the paper's table that is no dream, such as the ground-truth pictures of the captions."""

    name: str
    paper: tuple[Figure, ...]


@dataclass(frozen=True)
class Table:
    """A table, or a figure that compares variants.

    name: of its file. title: one line. source: where in the paper. meaning: what a number in it says.
    presets: by size, the configuration that the rows differ from. common: by size, settings of all rows.
    captions: by size, the captions themselves, or the name of a set: "coco", "embedded:12".
    seeds: by size.
    """

    name: str
    title: str
    source: str
    meaning: str
    presets: Mapping[Size, str]
    common: Mapping[Size, tuple[str, ...]]
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    references: tuple[Reference, ...]
    captions: Mapping[Size, tuple[str, ...] | str]
    seeds: Mapping[Size, tuple[int, ...]]

    def rows_at(self, size: Size) -> tuple[Row, ...]:
        """Those that are dreamt at this size, in order."""
        return tuple(row for row in self.rows if size in row.sizes)

    def columns_at(self, size: Size) -> tuple[Column, ...]:
        """Those that have a judge at this size."""
        return tuple(column for column in self.columns if size in column.judges)

    def settings(self, row: Row, size: Size) -> tuple[str, ...]:
        """All `part.key=value` of a row, in the order in which they apply to `presets[size]`."""
        return (*self.common.get(size, ()), *row.overrides, *row.own.get(size, ()))

    def config(self, row: Row, size: Size) -> DreamConfig:
        """The row's configuration; its seed, and its judge where columns differ, are still to be set.

        Raises: ConfigError.
        """
        return override(preset(self.presets[size]), self.settings(row, size))

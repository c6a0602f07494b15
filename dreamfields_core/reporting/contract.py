"""What a report is made of. Shares and precisions are fractions in [0, 1]; the page shows them in percent.

An object is one dream: a caption, a seed, and a variant of the configuration, which is a row of the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

History = Mapping[str, Sequence[float]]
Pool = Literal["random", "hard"]
Source = Literal["field", "mesh"]
"""What the judged pictures were taken of."""

POOLS: tuple[Pool, ...] = ("random", "hard")
SOURCES: tuple[Source, ...] = ("field", "mesh")


@dataclass(frozen=True)
class Entry:
    """One object, or why there is none.

    result: what its result.json says (flows/result.py), None where it failed. error: the sentence it failed with.
    files: name of an artifact -> its path relative to the page, with forward slashes.
    history: `step` and, of the same length, `loss`, `transmittance`, `similarity` and, where it was measured on the way,
    `correct`: 1 where the judge picked the caption then, 0 where not, NaN at steps where nobody asked.
    """

    variant: str
    caption: str
    seed: int
    result: Mapping[str, Any] | None = None
    error: str | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    history: History | None = None


@dataclass(frozen=True)
class Figure:
    """A figure of the paper: R-Precision by a judge. error: standard error. own: the judge also was the guide (italics there)."""

    judge: str
    mean: float
    error: float | None = None
    own: bool = False


@dataclass(frozen=True)
class Row:
    """A row of the table.

    name: the variant. paper: what the paper found for it, nothing where it has no such row. reference: its pictures were not dreamed (the
    true ones, an oracle): it is neither what differences are to nor the best of anything.
    """

    name: str
    paper: tuple[Figure, ...] = ()
    reference: bool = False


@dataclass(frozen=True)
class Change:
    """R-Precision of the same objects in the last night and now. error: standard error of the difference. fell: by more than that."""

    variant: str
    judge: str
    pool: Pool
    source: Source
    before: float
    now: float
    error: float
    objects: int
    fell: bool


@dataclass(frozen=True)
class Night:
    """The comparison with an earlier evaluation. since: its date."""

    since: str
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class Report:
    """rows: in the order of the table; variants that they do not name follow. judges: names, the first is the one that the page leads
    with. facts: such as date and code version, shown as they are."""

    title: str
    entries: tuple[Entry, ...]
    rows: tuple[Row, ...] = ()
    judges: tuple[str, ...] = ()
    night: Night | None = None
    facts: Mapping[str, str] = field(default_factory=dict)

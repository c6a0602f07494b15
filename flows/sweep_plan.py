"""What a sweep consists of: captions x seeds x variants of one configuration, each an order with a key that is known beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dreamfields_core.config import ConfigError, DreamConfig
from flows.order import Order, OrderError, address_of, check_encoders, check_places, order_of, settle, states_judge
from flows.slugs import plain_name
from flows.tables import Table, load_table
from flows.tables.types import Size
from storage.digests import json_digest
from tasks.caption_sets import CaptionSet, captions_from
from tasks.encoders import EncoderError

PLAIN = "as preset"
"""The one variant of a sweep without a table."""


@dataclass(frozen=True)
class Cell:
    """One object that is wanted. parameters: as the flow `dream` takes them. order: None where `error` says why there can be none."""

    variant: str
    caption: str
    seed: int
    parameters: dict[str, Any] = field(repr=False)
    order: Order | None = field(default=None, repr=False)
    error: str | None = None

    @property
    def key(self) -> str | None:
        """Under which the store knows the dream."""
        return self.order.key if self.order else None

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.caption} ({self.variant}, seed {self.seed})"

    @property
    def run_name(self) -> str:
        """The same for Prefect, which takes a name in braces for that of a parameter."""
        return self.name.replace("{", "{{").replace("}", "}}")


@dataclass(frozen=True)
class Plan:
    """A sweep before any work. name: the same for the same wishes, so that the same command goes on."""

    name: str
    captions: CaptionSet
    cells: tuple[Cell, ...]
    table: Table | None
    preset: str
    judges: tuple[str, ...]
    store: str
    out: Path


def plan_sweep(
    source: str | None = None,
    *,
    table: str | None = None,
    variants: Sequence[str] = (),
    seeds: Sequence[int] = (),
    preset: str = "draft",
    guidance: str | None = None,
    judge: str | None = None,
    settings: Sequence[str] = (),
    store: str | None = None,
    out: Path = Path("dreams"),
    score_only: bool = False,
) -> Plan:
    """Everything that can be known without work. A caption that cannot be dreamed is one cell's error, all else refuses the whole.

    Args:
      source: where the captions come from (tasks/caption_sets.py); by default the table's own.
      table: whose rows are the variants, and whose judges score; at its draft size for the preset draft, else at the paper's.
      variants: some of its rows; all of them by default.
      seeds: by default the table's own, else 0.
      settings: changes to the preset; a variant's own come after.
      score_only: neither pictures nor meshes; the sweep and its keys are the same, so that they can be made later.

    Raises:
      CaptionError, ConfigError, EncoderError, OrderError, TableError, StorageError: one sentence with the way out.
    """
    size: Size = "draft" if preset == "draft" else "paper"
    known = load_table(table) if table else None
    captions, rows = _captions(source, known, size), _rows(known, variants, size)
    seeds = list(seeds) or (list(known.seeds[size]) if known else [0])
    if len(set(seeds)) < len(seeds):
        raise OrderError(f"expected different seeds, got {seeds}: write for instance --seeds 0,1")
    columns = [column.judges[size] for column in known.columns_at(size)] if known else []
    judges = tuple(dict.fromkeys([judge] if judge else columns))
    address = address_of(store, out)
    check_places(out, address)
    shared: dict[str, Any] = {"preset": preset, "guidance": guidance, "judge": judges[0] if judges else None, "store": address}
    shared |= {"out": str(out), "among": list(captions.pool) or None, "judges": list(judges[1:]) or None}
    shared["score_only"] = score_only
    cells: list[Cell] = []
    for variant, changes in rows.items():
        own = [*settings, *changes]
        for seed in seeds:
            config = _settled(variant, preset, seed=seed, guidance=guidance, judge=shared["judge"], settings=own)
            check_encoders(config, judge_is_stated=states_judge(shared["judge"], own), judges=judges[1:])
            parameters = {**shared, "seed": seed, "settings": own}
            cells += [_cell(variant, config, {**parameters, "caption": caption}) for caption in captions.captions]
    name = "-".join([plain_name(captions.name), *([plain_name(table)] if table else []), preset])
    name += "-" + json_digest([captions.digest, rows, seeds, preset, guidance, judges, list(settings)])[:8]
    return Plan(name, captions, tuple(cells), known, preset, judges or (config.evaluate.judge,), address, out)


def listed(text: str) -> list[str]:
    """Names with commas between them, as the command line has them."""
    return [name.strip() for name in text.split(",") if name.strip()]


def seeds_of(text: str) -> list[int]:
    """Numbers with commas between them. Raises: OrderError."""
    try:
        return [int(number) for number in listed(text)]
    except ValueError:
        raise OrderError(f'expected whole numbers as seeds, got "{text}": write for instance --seeds 0,1') from None


def _captions(source: str | None, table: Table | None, size: Size) -> CaptionSet:
    own = table.captions[size] if table else None
    if source is None and isinstance(own, tuple):
        assert table is not None
        return CaptionSet(table.name, own)
    if source is None and own is None:
        raise OrderError("expected captions, got neither a set nor a table: write for instance `dreamfields sweep embedded:12`")
    return captions_from(source or str(own))


def _rows(table: Table | None, names: Sequence[str], size: Size) -> dict[str, list[str]]:
    """Variant -> its settings."""
    if table is None:
        if names:
            raise OrderError(f"expected a table whose rows are the variants {', '.join(names)}, got none: add --table")
        return {PLAIN: []}
    rows = {row.name: list(table.settings(row, size)) for row in table.rows_at(size)}
    if unknown := [name for name in names if name not in rows]:
        raise OrderError(f'expected variants among the rows of {table.name} ({", ".join(rows)}), got "{unknown[0]}"')
    return {name: rows[name] for name in names or rows}


def _settled(variant: str, preset: str, **options: Any) -> DreamConfig:
    """A variant that cannot be is told by its name."""
    try:
        return settle(preset, **options)
    except ConfigError as error:
        raise ConfigError(str(error) if variant == PLAIN else f'variant "{variant}": {error}') from None


def _cell(variant: str, config: DreamConfig, parameters: dict[str, Any]) -> Cell:
    caption = parameters["caption"]
    among, judges = parameters["among"] or (), parameters["judges"] or ()
    place: dict[str, Any] = {name: parameters[name] for name in ("preset", "store", "score_only")} | {"out": Path(parameters["out"])}
    try:
        order = order_of(caption, config=config, among=among, judges=judges, **place)
    except EncoderError as error:
        return Cell(variant, caption, config.seed, parameters, error=str(error))
    return Cell(variant, caption, config.seed, parameters, order)

"""What is asked for: a caption and everything that decides its dream, checked before any work begins."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dreamfields_core import captions, presets
from dreamfields_core.config import DreamConfig, override, validate
from flows.slugs import plain_name
from storage.digests import json_digest
from storage.errors import StorageError
from storage.store import open_store
from tasks.encoders import card, unknown_words

STORE_VARIABLE = "DREAMFIELDS_STORE"


class OrderError(ValueError):
    """Something asked for that cannot be given; its text is one sentence with the way out."""


@dataclass(frozen=True)
class Order:
    """caption: as it is shown. preset: the name it started from. store: address of the store. folder: of this
    run's files. unknown_words: of the caption, to the guidance model. among: captions that the judge chooses from, or () for the usual.
    judges: further ones. score_only: neither pictures for people nor a mesh are wanted."""

    caption: str
    preset: str
    config: DreamConfig
    store: str
    folder: Path
    unknown_words: tuple[str, ...] = ()
    among: tuple[str, ...] = ()
    judges: tuple[str, ...] = ()
    score_only: bool = False

    @property
    def key(self) -> str:
        """Under which the store knows the dream."""
        return dream_key(self.caption, self.config, self.among)

    @property
    def config_digest(self) -> str:
        """sha256 of the configuration as canonical JSON."""
        return json_digest(self.config.model_dump(mode="json"))


def take_order(
    caption: str,
    *,
    preset: str = "draft",
    seed: int | None = None,
    guidance: str | None = None,
    judge: str | None = None,
    settings: Sequence[str] = (),
    store: str | None = None,
    out: Path = Path("dreams"),
    among: Sequence[str] = (),
    judges: Sequence[str] = (),
    score_only: bool = False,
) -> Order:
    """Check everything that can be checked without work.

    Raises:
      CaptionError, ConfigError, EncoderError, OrderError: one sentence with the way out.
    """
    caption = captions.check(caption)
    config = settle(preset, seed=seed, guidance=guidance, judge=judge, settings=settings)
    check_encoders(config, judge_is_stated=states_judge(judge, settings), judges=judges)
    order = order_of(
        caption,
        preset=preset,
        config=config,
        store=address_of(store, out),
        out=out,
        among=among,
        judges=judges,
        score_only=score_only,
    )
    check_places(order.folder, order.store)
    return order


def order_of(
    caption: str,
    *,
    preset: str,
    config: DreamConfig,
    store: str,
    out: Path,
    among: Sequence[str] = (),
    judges: Sequence[str] = (),
    score_only: bool = False,
) -> Order:
    """The order for a caption and models that have been checked; nothing is touched. Raises: EncoderError."""
    unknown = unknown_words(config.guidance.name, caption)
    folder = out / folder_name(caption, dream_key(caption, config, among))
    return Order(caption, preset, config, store, folder, unknown, tuple(among), tuple(judges), score_only)


def dream_key(caption: str, config: DreamConfig, among: Sequence[str] = ()) -> str:
    """Under which the store knows the dream, before and after it is dreamed."""
    return json_digest([caption, config.model_dump(mode="json"), *([list(among)] if among else [])])


def sweep_key(name: str) -> str:
    """Under which the store knows a sweep."""
    return json_digest(["sweep", name])


def folder_name(caption: str, key: str) -> str:
    """Of the run's own folder among the others; another dream has another."""
    return f"{plain_name(caption)}-{key[:8]}"


def settle(
    preset: str, *, seed: int | None = None, guidance: str | None = None, judge: str | None = None, settings: Sequence[str] = ()
) -> DreamConfig:
    """The preset, then the settings, then what has an option of its own.

    Raises:
      ConfigError: an unknown preset or key, or an impossible value.
    """
    values = override(presets.preset(preset), tuple(settings)).model_dump(mode="json")
    if seed is not None:
        values["seed"] = seed
    if guidance is not None:
        values["guidance"]["name"] = guidance
    if judge is not None:
        values["evaluate"]["judge"] = judge
    return validate(values)


def address_of(store: str | None, out: Path) -> str:
    """The store that was named, else the user's, else the one beside the dreams."""
    return store or os.environ.get(STORE_VARIABLE) or str(out / "store")


def states_judge(judge: str | None, settings: Sequence[str]) -> bool:
    """Whether somebody has named the judge, and so may have it guide too."""
    return judge is not None or any(setting.strip().startswith("evaluate.judge") for setting in settings)


def check_encoders(config: DreamConfig, *, judge_is_stated: bool, judges: Sequence[str] = ()) -> None:
    """Whether both models are there, and further judges, and the judge is another than the guide. Raises: EncoderError, OrderError."""
    guide, judge, *_ = map(card, (config.guidance.name, config.evaluate.judge, *judges))
    if guide.shares_weights(judge) and not judge_is_stated:
        raise OrderError(
            f'the dream would be judged by "{judge.name}", which guides it: '
            f"name another with --judge, or state --judge {judge.name} to have it so"
        )


def check_places(folder: Path, store: str) -> None:
    """Whether both can be written. Raises: OrderError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OrderError(f"expected a folder that can be written, got {folder} ({error.strerror}): choose another with --out") from None
    if store.startswith("memory:"):
        raise OrderError("expected a store that several processes can see, got memory://: give a folder or s3://bucket/prefix")
    try:
        open_store(store).check_writable()
    except StorageError as error:
        raise OrderError(str(error)) from error

"""One caption to one object, conducted by Prefect: encode, optimise, render and mesh side by side, score."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from prefect import flow
from pydantic import Field

from dreamfields_core.captions import LONGEST
from dreamfields_core.config import DreamConfig
from flows.order import take_order
from flows.page import Progress, show_result
from flows.result import fulfil
from storage.store import open_store
from tasks.conducted import as_task, record_of
from tasks.step import Done, Input, Place, Step, is_done

Caption = Annotated[str, Field(min_length=1, max_length=LONGEST, description='What to dream, for instance "a red mushroom".')]
Candidate = Annotated[str, Field(min_length=1, description="As retrieval writes a caption, which may be longer than what is dreamed.")]
Preset = Literal["draft", "low", "medium", "high"]
Seed = Annotated[int, Field(ge=0, lt=2**32)]
Setting = Annotated[str, Field(pattern=r"^[a-z_.]+=.+$", description="part.key=value, as `dreamfields settings` lists them")]


@flow(name="dream", flow_run_name="{caption}", persist_result=False)
def dream(
    caption: Caption,
    preset: Preset = "draft",
    seed: Seed | None = None,
    guidance: str | None = None,
    judge: str | None = None,
    settings: list[Setting] | None = None,
    store: str | None = None,
    out: str = "dreams",
    among: list[Candidate] | None = None,
    judges: list[str] | None = None,
    score_only: bool = False,
) -> dict[str, Any]:
    """Dream one caption.

    Args:
      caption: what to dream.
      preset: draft (minutes on two cores), or the paper's low, medium and high.
      seed: the same seed gives the same object.
      guidance: the image-text model to optimise with.
      judge: the image-text model that scores the result.
      settings: changes to the preset.
      store: folder or s3://bucket/prefix; by default $DREAMFIELDS_STORE, else a folder `store` beside the dreams.
      out: folder in which the dream gets one of its own.
      among: captions that the judge chooses from; by default those of the embedded models' language.
      judges: further judges.
      score_only: only the field and its score; no pictures and no mesh are made.

    Returns:
      What result.json says.
    """
    order = take_order(
        caption,
        preset=preset,
        seed=seed,
        guidance=guidance,
        judge=judge,
        settings=settings or (),
        store=store,
        out=Path(out),
        among=among or (),
        judges=judges or (),
        score_only=score_only,
    )
    order.folder.mkdir(parents=True, exist_ok=True)
    place = Place(open_store(order.store), Progress(order.config.optim.steps), order.folder / "preview.png")
    result = fulfil(order, ByPrefect(place, order.config), place.store)
    show_result(order, result, place.store)
    return result


class ByPrefect:
    """Conducts the steps as task runs of the current flow run."""

    def __init__(self, place: Place, config: DreamConfig) -> None:
        self._place, self._config = place, config

    def __call__(self, step: Step, **inputs: Input) -> Done:
        task, cached = self._task(step, inputs)
        return Done(record_of(task(self._config, inputs)), cached)

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        task, cached = self._task(step, inputs)
        future = task.submit(self._config, inputs)
        return lambda: Done(record_of(future.result()), cached)

    def has(self, step: Step, **inputs: Input) -> bool:
        return is_done(step, self._place, self._config, inputs)

    def under(self, config: DreamConfig) -> ByPrefect:
        return ByPrefect(self._place, config)

    def _task(self, step: Step, inputs: dict[str, Input]) -> tuple[Any, bool]:
        return as_task(step, self._place), is_done(step, self._place, self._config, inputs)

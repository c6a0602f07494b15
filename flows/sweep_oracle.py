"""The row of true pictures: what the judges say where nothing had to be dreamed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from flows.recipe import judged_by
from flows.sweep_plan import Plan
from flows.sweep_run import sentence
from storage.artifacts import put_artifact
from tasks.caption_sets import understood
from tasks.encoders import card
from tasks.pools import keep_pool
from tasks.step import Input, Place, perform
from tasks.truths import ORACLE


def oracle_of(plan: Plan, place: Place) -> list[dict[str, Any]]:
    """Caption, scores by judge and a poster, for every caption that has a true picture: one that was given, or what the language means."""
    return list(_scores(plan, place))


def _scores(plan: Plan, place: Place) -> Iterator[dict[str, Any]]:
    order = next((cell.order for cell in plan.cells if cell.order), None)
    if order is None:
        return
    pool = keep_pool(place.store, plan.captions.pool)
    for caption in plan.captions.captions:
        truth = _truth(plan, caption, place)
        if truth is None:
            continue
        inputs: dict[str, Input] = {"caption": caption, **truth, **({"pool": pool} if pool else {})}
        try:
            done = {
                name: perform(ORACLE, place, judged_by(order.config, name), {**inputs, "judge": card(name).digest}) for name in plan.judges
            }
        except Exception as error:  # a picture that cannot be read costs its own figure, not the sweep
            place.report({"event": "note", "text": f"the true picture of “{caption}” could not be judged: {sentence(error)}"})
            continue
        yield {
            "caption": caption,
            "scores": {name: one.record.values for name, one in done.items()},
            "poster": done[plan.judges[0]].output("poster.webp").to_json(),
        }


def _truth(plan: Plan, caption: str, place: Place) -> dict[str, Input] | None:
    """The picture that was given, nothing more where the language tells it, None where there is no truth."""
    path = plan.captions.pictures.get(caption)
    if path is not None and path.is_file():
        return {"picture": put_artifact(place.store, path.name, path.read_bytes(), "image/*")}
    if path is not None:
        text = f"expected the true picture of “{caption}” at {path}, found none: correct the path and run the sweep again"
        place.report({"event": "note", "text": text})
    return {} if understood(caption) else None

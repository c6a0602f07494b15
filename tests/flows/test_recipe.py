"""The recipe, with a conductor that only writes down what it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dreamfields_core.config import DreamConfig
from flows.recipe import make_object
from storage.artifacts import put_artifact
from storage.contract import Store
from storage.steps import StepRecord
from storage.store import open_store
from tasks.step import Done, Input, Step
from tasks.steps import MESH, RENDER, VIEWS

FILES = ("text_embedding.npy", "field.safetensors", "glimpses.npz", "views.npz", "mesh.glb")


def done(store: Store, step: Step) -> Done:
    """As if the step had been done."""
    outputs = tuple(put_artifact(store, name, name.encode(), "text/plain") for name in FILES)
    return Done(StepRecord(step.name, 1, "key", outputs=outputs), cached=False)


class WritesDown:
    """Every step succeeds; some are there already."""

    def __init__(self, store: Store, there: tuple[Step, ...]) -> None:
        self._store, self._there = store, there
        self.asked: list[str] = []

    def __call__(self, step: Step, **inputs: Input) -> Done:
        self.asked.append(step.name)
        return done(self._store, step)

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        return lambda: self(step, **inputs)

    def has(self, step: Step, **inputs: Input) -> bool:
        assert inputs.keys() >= {"field", "caption"}, "asked before there is a field to render"
        return step in self._there

    def under(self, config: DreamConfig) -> WritesDown:
        return self


class Fails:
    """One step fails, and whatever is begun beside it ends badly too."""

    def __init__(self, store: Store, wrong: Step) -> None:
        self._store, self._wrong = store, wrong
        self.awaited: list[str] = []

    def __call__(self, step: Step, **inputs: Input) -> Done:
        if step is self._wrong:
            raise ValueError(f"{step.name} went wrong")
        return done(self._store, step)

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        def result() -> Done:
            self.awaited.append(step.name)
            raise RuntimeError(f"{step.name} went wrong too")

        return result

    def has(self, step: Step, **inputs: Input) -> bool:
        return False

    def under(self, config: DreamConfig) -> Fails:
        return self


@pytest.mark.parametrize("wrong", [VIEWS, MESH])
def test_what_was_begun_beside_is_awaited_before_an_error_is_told(wrong: Step, tmp_path: Path) -> None:
    conduct = Fails(open_store(tmp_path), wrong)
    with pytest.raises(ValueError, match=f"^{wrong.name} went wrong$"):
        make_object(conduct, "a red mushroom", DreamConfig())
    assert conduct.awaited == ["render"]


@pytest.mark.parametrize(
    "there", [(), (RENDER,), (MESH,), (RENDER, MESH)], ids=lambda there: "+".join(step.name for step in there) or "nothing"
)
def test_a_score_makes_no_picture_and_no_mesh_but_keeps_those_that_are_there(there: tuple[Step, ...], tmp_path: Path) -> None:
    conduct = WritesDown(open_store(tmp_path), there)
    made = make_object(conduct, "a red mushroom", DreamConfig(), score_only=True)
    whole = there == (RENDER, MESH)
    assert (made.pictures is not None) == (made.mesh is not None) == (made.score.mesh is not None) == whole
    assert {"encode", "optimize", "views", "score"} <= set(conduct.asked)
    assert {"render", "mesh", "mesh_score"} & set(conduct.asked) == ({"render", "mesh", "mesh_score"} if whole else set())

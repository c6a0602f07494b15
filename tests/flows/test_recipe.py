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
from tasks.steps import MESH, VIEWS

FILES = ("text_embedding.npy", "field.safetensors", "glimpses.npz", "views.npz", "mesh.glb")


class Fails:
    """One step fails, and whatever is begun beside it ends badly too."""

    def __init__(self, store: Store, wrong: Step) -> None:
        self._store, self._wrong = store, wrong
        self.awaited: list[str] = []

    def __call__(self, step: Step, **inputs: Input) -> Done:
        if step is self._wrong:
            raise ValueError(f"{step.name} went wrong")
        outputs = tuple(put_artifact(self._store, name, name.encode(), "text/plain") for name in FILES)
        return Done(StepRecord(step.name, 1, "key", outputs=outputs), cached=False)

    def start(self, step: Step, **inputs: Input) -> Callable[[], Done]:
        def result() -> Done:
            self.awaited.append(step.name)
            raise RuntimeError(f"{step.name} went wrong too")

        return result

    def under(self, config: DreamConfig) -> Fails:
        return self


@pytest.mark.parametrize("wrong", [VIEWS, MESH])
def test_what_was_begun_beside_is_awaited_before_an_error_is_told(wrong: Step, tmp_path: Path) -> None:
    conduct = Fails(open_store(tmp_path), wrong)
    with pytest.raises(ValueError, match=f"^{wrong.name} went wrong$"):
        make_object(conduct, "a red mushroom", DreamConfig())
    assert conduct.awaited == ["render"]

"""The one caching rule: what makes a key, what counts as done, and who does it when many are asked."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from storage.artifacts import get_artifact
from storage.contract import Store
from storage.store import open_store
from tasks.step import Done, Event, Made, Place, Step, Work, key_of, perform
from tests.tasks.tiny import tiny

CONFIG = tiny()


class Kitchen:
    """A step that counts how often it is done."""

    def __init__(self, store: Store) -> None:
        self.runs: list[str] = []
        self.said: list[Event] = []
        self.place = Place(store, self.said.append)
        self.step = Step("cook", 1, ("mesh", "guidance.name"), self._run)

    def _run(self, work: Work) -> Made:
        self.runs.append(work.key)
        dish = f"{work.text('what')} with {work.config.mesh.faces} faces".encode()
        return Made((work.keep("dish.txt", dish, "text/plain"),), {"length": len(dish)})

    def order(self, what: str = "soup", *settings: str) -> Done:
        return perform(self.step, self.place, tiny(*settings), {"what": what})


@pytest.fixture
def kitchen(tmp_path) -> Kitchen:
    return Kitchen(open_store(tmp_path / "store"))


def test_a_second_call_is_cached(kitchen: Kitchen) -> None:
    first, second = kitchen.order(), kitchen.order()
    assert (first.cached, second.cached, len(kitchen.runs)) == (False, True, 1)
    assert first.record == second.record
    assert get_artifact(kitchen.place.store, second.output("dish.txt")) == b"soup with 800 faces"
    assert second.record.values == {"length": 19}
    assert second.record.config == {"mesh": CONFIG.mesh.model_dump(mode="json"), "guidance.name": "embedded"}


@pytest.mark.parametrize(("settings", "cached"), [("seed=7", True), ("optim.steps=99", True), ("mesh.faces=900", False)])
def test_only_what_a_step_reads_counts(kitchen: Kitchen, settings: str, cached: bool) -> None:
    kitchen.order()
    assert kitchen.order("soup", settings).cached == cached


def test_the_key_is_made_of_name_version_settings_and_inputs(kitchen: Kitchen) -> None:
    step, inputs = kitchen.step, {"what": "soup"}
    other_file = perform(step, kitchen.place, CONFIG, {"what": "stew"}).output("dish.txt")
    keys = [
        key_of(step, CONFIG, inputs),
        key_of(replace(step, name="bake"), CONFIG, inputs),
        key_of(replace(step, version=2), CONFIG, inputs),
        key_of(step, tiny("mesh.faces=900"), inputs),
        key_of(step, CONFIG, {"what": "bread"}),
        key_of(step, CONFIG, {"whom": "soup"}),
        key_of(step, CONFIG, {"what": other_file}),
    ]
    assert len(set(keys)) == len(keys)
    assert key_of(step, CONFIG, {"what": replace(other_file, name="renamed")}) == keys[-1]


@pytest.mark.parametrize("harm", ["deleted", "damaged", "record deleted", "record damaged"])
def test_what_vanished_or_was_damaged_is_made_again(kitchen: Kitchen, harm: str, caplog: pytest.LogCaptureFixture) -> None:
    first = kitchen.order()
    store, ref = kitchen.place.store, first.output("dish.txt")
    key = f"artifacts/cook/{first.record.key}.json" if "record" in harm else ref.key
    store.delete(key) if "deleted" in harm else store.put(key, store.get(key)[:-1] + b"!")
    again = kitchen.order()
    assert not again.cached
    assert again.output("dish.txt") == ref
    assert get_artifact(store, ref) == b"soup with 800 faces"
    assert kitchen.order().cached
    assert len(caplog.messages) == (0 if harm == "record deleted" else 1)


def test_many_at_once_do_it_once(kitchen: Kitchen) -> None:
    hold, cook = threading.Event(), kitchen.step.run

    def slowly(work: Work) -> Made:
        hold.wait(10)
        return cook(work)

    kitchen.step = replace(kitchen.step, run=slowly)
    threads = [threading.Thread(target=kitchen.order) for _ in range(4)]
    for thread in threads:
        thread.start()
    while not any("waiting" in event["text"] for event in kitchen.said):
        pass
    hold.set()
    for thread in threads:
        thread.join()
    assert len(kitchen.runs) == 1


def test_a_step_that_fails_leaves_nothing_that_counts(kitchen: Kitchen) -> None:
    def burn(work: Work) -> Made:
        work.keep("dish.txt", b"half", "text/plain")
        raise RuntimeError("smoke")

    good = kitchen.step
    kitchen.step = replace(good, run=burn)
    with pytest.raises(RuntimeError, match="smoke"):
        kitchen.order()
    kitchen.step = good
    assert not kitchen.order().cached


def test_two_stores_hold_the_same(tmp_path) -> None:
    a, b = (Kitchen(open_store(tmp_path / name)).order() for name in "ab")
    assert a.record.outputs == b.record.outputs and a.record.key == b.record.key

"""Nights: compared with the last one, what fell by more than its standard error is said, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dreamfields_core.config import DreamConfig
from dreamfields_core.reporting.contract import Entry
from flows.night import Anew, Gone, judge_again, judged, last_night, remember
from flows.recipe import Plainly
from flows.sweep_record import TRUTHS, Member
from storage.store import open_store
from tasks.step import Place
from tasks.steps import OPTIMIZE


def scores(correct: bool) -> dict[str, Any]:
    said = {"similarity": 0.3 if correct else 0.1, "rank": 1 if correct else 5, "correct": correct, "ranks": [1], "pool": 9}
    return {"judge": {"cosine": 0.3, "field": {"random": said, "hard": said}, "mesh": {"random": said, "hard": said}}}


def entries(variant: str, recognised: int, *, of: int = 12) -> list[Entry]:
    return [Entry(variant, f"a caption {i}", 0, {"scores": scores(i < recognised)}) for i in range(of)]


def test_what_fell_by_more_than_its_error_is_flagged_and_what_is_lost_is_named(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    first = remember(store, "s", entries("a", 12) + entries("b", 5) + [Entry("c", "a failure", 0, error="no")], ["judge"])
    assert first.night is None and first.fell == [] and first.lost == ()
    second = remember(store, "s", entries("a", 6) + entries("b", 8), ["judge"])
    assert second.night is not None and {change.variant for change in second.night.changes if change.fell} == {"a"}
    assert "a, judge, random pool, field: 100.0% to 50.0%" in second.fell
    assert len(second.lost) == 6 and second.lost[0] == "a caption 6 (a, seed 0), judge"
    third = remember(store, "s", entries("a", 6) + entries("b", 8), ["judge"])
    assert third.fell == [] and third.lost == ()


def test_nights_of_one_sweep_say_nothing_of_another(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    remember(store, "one", entries("a", 12), ["judge"])
    assert last_night(store, "other") is None
    assert remember(store, "other", entries("a", 1), ["judge"]).night is None


def test_true_pictures_are_no_objects_of_a_night(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    remember(store, "s", [Entry(TRUTHS, "a mug", 0, {"scores": {"judge": {"field": {}}}}), *entries("a", 1)], ["judge"])
    night = last_night(store, "s")
    assert night is not None and {entry["variant"] for entry in night["entries"]} == {"a"}


def test_tonights_scores_take_the_place_of_the_stored_ones() -> None:
    stored = [*entries("a", 1, of=2), Entry("a", "never made", 0, error="no")]
    tonight = judged(stored, {"k1": scores(True)}, [Member("a", "a caption 1", 0, "k1"), Member("a", "a caption 0", 0, "k0")])
    assert [entry.result and entry.result["scores"]["judge"]["field"]["random"]["correct"] for entry in tonight] == [True, True, None]


def test_a_night_dreams_nothing(tmp_path: Path) -> None:
    conductor = Anew(Plainly(Place(open_store(tmp_path)), DreamConfig()))
    with pytest.raises(AssertionError, match="dreams nothing"):
        conductor(OPTIMIZE, guide="x")


def test_an_object_that_is_gone_is_said_to_be(tmp_path: Path) -> None:
    with pytest.raises(Gone, match="missing or damaged"):
        judge_again(open_store(tmp_path), "0" * 64, [], lambda config: Plainly(Place(open_store(tmp_path)), config))

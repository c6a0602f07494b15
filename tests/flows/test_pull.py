"""Pulling: only what changed, as much as was asked for."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from flows.order import OrderError, sweep_key
from flows.pull import Only, pull
from flows.pull_object import ABOUT
from storage.contract import Store
from storage.digests import json_digest
from storage.steps import StepRecord, put_record
from storage.store import open_store
from tests.flows.pulled import Counting, assert_whole, counts, files, objects
from tests.flows.records import glb, keep_dream


def test_the_second_pull_of_500_objects_moves_no_bytes(to: Path) -> None:
    store = open_store("memory://")
    for seed in range(500):
        keep_dream(store, f"object number {seed % 50}", seed=seed)
    counting = Counting(store)
    first = pull(counting, to)
    assert counts(first) == (500, 0, 0, 0, 0) and first.moved > 0 and len(counting.read) == 1000
    before = files(to)
    counting.read.clear()
    second = pull(counting, to)
    assert counts(second) == (0, 0, 0, 500, 0) and second.moved == 0
    assert counting.read == [] and files(to) == before
    assert_whole(to)


def test_what_was_added_changed_and_removed_is_told(store: Store, to: Path) -> None:
    kept, changed, removed = (keep_dream(store, f"object {seed}", seed=seed) for seed in range(3))
    pull(store, to)
    keep_dream(store, "object 1", seed=1, mesh=b"another mesh")
    keep_dream(store, "object 3", seed=3)
    store.delete(f"artifacts/dream/{removed.key}.json")
    result = pull(store, to)
    assert [name.rpartition("-")[0] for name in (*result.added, *result.changed, *result.removed, *result.same)] == [
        "object-3",
        "object-1",
        "object-2",
        "object-0",
    ]
    assert result.removed[0] not in objects(to) and (to / result.removed[0]).is_dir()
    assert (to / result.changed[0] / "mesh.glb").read_bytes() == b"another mesh"
    assert kept.key != changed.key


def test_what_is_asked_for_again_is_stamped_anew_and_is_the_same(store: Store, to: Path) -> None:
    keep_dream(store)
    pull(store, to)
    before = files(to)
    keep_dream(store, created="2026-11-21T12:00:00+00:00")
    assert counts(pull(store, to)) == (0, 0, 0, 1, 0) and files(to) == before


def test_a_new_score_is_told_without_fetching_the_mesh(store: Store, to: Path) -> None:
    keep_dream(store, cosine=0.2)
    pull(store, to)
    keep_dream(store, cosine=0.4)
    result = pull(store, to)
    assert (len(result.changed), result.moved) == (1, 0)
    assert objects(to)[result.changed[0]]["scores"]["judge"]["cosine"] == 0.4
    assert_whole(to)


def test_filters(store: Store, to: Path) -> None:
    early = keep_dream(store, "A Red Mushroom", seed=1, cosine=0.1)
    late = keep_dream(store, "a red mug", seed=2, cosine=0.4, created="2026-11-21T08:00:00+00:00")
    members = [{"variant": "", "caption": "a red mug", "seed": 2, "key": late.key, "error": None}, {"key": None}]
    put_record(store, StepRecord(step="sweep", version=1, key=sweep_key("mugs"), values={"name": "mugs", "entries": members}))

    def found(**only: object) -> set[str]:
        target = to / json_digest(str(only))[:8]
        pull(store, target, only=Only(**only))  # type: ignore[arg-type]
        return {about["record"] for about in objects(target).values()}

    both = {early.key, late.key}
    assert found() == found(caption="red m") == found(min_score=0.1) == both
    assert found(caption="mushroom") == found(seed=1) == {early.key}
    assert found(min_score=0.2) == found(since=datetime(2026, 11, 21, tzinfo=UTC)) == found(sweep="mugs") == {late.key}
    assert found(caption="mushroom", seed=2) == set()
    with pytest.raises(OrderError, match='got "rugs"'):
        found(sweep="rugs")


def test_a_moment_without_a_zone_is_utc(store: Store, to: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep_dream(store, created="2026-11-21T08:00:00+00:00")
    monkeypatch.setenv("TZ", "America/New_York")
    time.tzset()
    try:
        assert len(pull(store, to, only=Only(since=datetime(2026, 11, 21, 7))).added) == 1
        assert counts(pull(store, to, only=Only(since=datetime(2026, 11, 21, 9)))) == (0, 0, 0, 0, 0)
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_narrower_pull_leaves_what_a_wider_one_brought(store: Store, to: Path) -> None:
    for seed in range(3):
        keep_dream(store, seed=seed)
    pull(store, to)
    before = files(to)
    assert counts(pull(store, to, only=Only(seed=1))) == (0, 0, 0, 1, 0) and files(to) == before


def test_formats_and_further_files(store: Store, to: Path) -> None:
    more = {"turntable.mp4": b"film", "mesh_lod1.glb": glb(), "field.safetensors": b"field", "../../escaped.txt": b"!"}
    keep_dream(store, mesh=glb(), files=more)
    (name,) = pull(store, to).added
    assert {path.name for path in (to / name).iterdir()} == {"mesh.glb", "mesh_lod1.glb", ABOUT}
    pull(store, to, formats=["usdz", "obj"], also=["turntable.mp4"])
    made = {f"{mesh}{end}" for mesh in ("mesh", "mesh_lod1") for end in (".usdz", ".obj", ".mtl", ".png", "_normal.png", ".json")}
    assert made | {"turntable.mp4"} == set(objects(to)[name]["files"])
    assert b"mtllib mesh_lod1.mtl" in (to / name / "mesh_lod1.obj").read_bytes()
    assert pull(store, to, formats=["obj", "usdz"], also=["turntable.mp4"]).moved == 0
    assert pull(store, to / "other", also=["../../escaped.txt"]).refused
    with pytest.raises(OrderError, match="a format among glb, obj, ply, stl, usdz"):
        pull(store, to, formats=["fbx"])

"""Pulling from several stores, from an object store, by the flow; and what is removed from a folder."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from flows.order import OrderError
from flows.pull import pull
from storage.contract import Store
from storage.store import open_store
from tests.flows.pulled import Counting, assert_whole, counts, files, objects
from tests.flows.records import keep_dream


@pytest.mark.parametrize("emptied", [False, True])
def test_a_store_without_dreams_is_refused_and_nothing_is_taken_for_removed(store: Store, to: Path, emptied: bool) -> None:
    if emptied:
        record = keep_dream(store)
        pull(store, to)
        store.delete(f"artifacts/dream/{record.key}.json")
    before = files(to)
    with pytest.raises(OrderError, match="check its address"):
        pull(store, to, prune=True)
    assert files(to) == before


def test_pruning_deletes_our_files_and_not_those_beside_them(store: Store, to: Path) -> None:
    alone, shared = (keep_dream(store, "an object", seed=seed) for seed in range(2))
    pull(store, to)
    names = {about["record"]: name for name, about in objects(to).items()}
    (to / names[shared.key] / "mesh.glb.meta").write_text("an engine's")
    keep_dream(store, "another")
    for record in (alone, shared):
        store.delete(f"artifacts/dream/{record.key}.json")
    assert len(pull(store, to, prune=True).removed) == 2
    assert not (to / names[alone.key]).exists()
    assert [path.name for path in (to / names[shared.key]).iterdir()] == ["mesh.glb.meta"]


def test_pruning_deletes_what_an_earlier_pull_let_stand(store: Store, to: Path, tmp_path: Path) -> None:
    kept, gone = (keep_dream(store, seed=seed) for seed in range(2))
    other = open_store(tmp_path / "other")
    there = keep_dream(other, "from there")
    pull(other, to)
    pull(store, to)
    name = next(name for name, about in objects(to).items() if about["record"] == gone.key)
    shutil.copytree(to / name, to / "a-copy")
    store.delete(f"artifacts/dream/{gone.key}.json")
    assert pull(store, to).removed == [name] and (to / name).is_dir()
    assert pull(store, to, prune=True).removed == [name] and not (to / name).exists()
    assert (to / "a-copy" / "mesh.glb").is_file(), "somebody's own"
    assert {about["record"] for about in objects(to).values()} == {kept.key, there.key}
    assert pull(store, to, prune=True).removed == []
    assert_whole(to)


@pytest.mark.slow
def test_an_object_store_gives_the_same(store: Store, to: Path, s3: str) -> None:
    remote = open_store(f"{s3}/dreams")
    for seed in range(10):
        keep_dream(remote, seed=seed)
        keep_dream(store, seed=seed)
    assert counts(pull(f"{s3}/dreams", to)) == (10, 0, 0, 0, 0)
    counting = Counting(remote)
    assert counts(pull(counting, to)) == (0, 0, 0, 10, 0) and counting.read == []
    pull(store, to / "local")
    strip = {name: {**about, "store": ""} for name, about in objects(to).items()}
    assert strip == {name: {**about, "store": ""} for name, about in objects(to / "local").items()}


def test_a_folder_may_collect_from_several_stores(store: Store, to: Path, tmp_path: Path) -> None:
    keep_dream(store, "from here")
    other = open_store(tmp_path / "other")
    keep_dream(other, "from there")
    pull(store, to)
    (there,) = pull(other, to).added
    assert {about["caption"] for about in objects(to).values()} == {"from here", "from there"}
    keep_dream(other, "from there too")
    store_keys = other.list("artifacts/dream")
    other.delete(next(key for key in store_keys if objects(to)[there]["record"] in key))
    result = pull(other, to)
    assert (result.removed, len(result.added)) == ([there], 1)
    assert {about["caption"] for about in objects(to).values()} == {"from here", "from there too"}


@pytest.mark.slow
def test_the_flow_is_the_same_pull(store: Store, to: Path) -> None:
    from prefect.testing.utilities import prefect_test_harness

    from flows.pull_flow import PullIncomplete, pull_assets

    good, bad = keep_dream(store, "a good one"), keep_dream(store, "a bad one", seed=1)
    store.delete(bad.output("mesh.glb").key)
    with prefect_test_harness(server_startup_timeout=120):
        result = pull_assets(store.url, str(to), seed=0)
        with pytest.raises(PullIncomplete, match="every object to be whole, but 1 are not: a-bad-one-"):
            pull_assets(store.url, str(to))
    assert [about["record"] for about in objects(to).values()] == [good.key]
    assert result["added"] == list(objects(to)) and result["refused"] == {} and json.dumps(result)

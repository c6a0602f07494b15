"""`dreamfields sweep`, typed; the same objects through Dask; and a night over what it left."""

from __future__ import annotations

import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from prefect.testing.utilities import prefect_test_harness

from flows.coco_sweep import coco_sweep
from flows.nightly_eval import nightly_eval
from flows.sweep_record import TRUTHS, members, sweeps
from storage.checkpoints import latest_checkpoint
from storage.contract import Store
from storage.steps import StepRecord, find_record, read_records
from storage.store import open_store
from tests.flows.site import wait_for
from tests.tasks.processes import Process, gone, workers_of
from tests.tasks.tiny import SETTINGS

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]
CAPTIONS = "a red mushroom\nxyzzy\na blue house\n"


def sweep(folder: Path, *more: str) -> Process:
    """The command, running."""
    settings = [text for setting in SETTINGS for text in ("--set", setting)]
    return Process("flows.cli", "sweep", str(folder / "captions.txt"), "--out", str(folder / "dreams"), *settings, *more)


def records(store: Store) -> list[StepRecord]:
    """Of the objects that the store's one sweep has."""
    (found,) = sweeps(store)
    return [record for member in members(found) if member.key and (record := find_record(store, "dream", member.key))]


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sweep of two objects and one refusal; not to be changed."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "captions.txt").write_text(CAPTIONS)
    process = sweep(folder)
    assert process.end() == 1, process.text()
    assert "3 objects, 0 there already, 2 to dream, 1 refused" in process.text()
    assert "1 could not be dreamed: expected a caption with words" in process.text()
    return folder


@pytest.fixture
def again(swept: Path, tmp_path: Path) -> Path:
    """A copy, to be changed at will."""
    shutil.copytree(swept, tmp_path / "again")
    return tmp_path / "again"


@pytest.fixture(scope="module")
def server() -> Iterator[None]:
    with prefect_test_harness(server_startup_timeout=240):
        yield


def test_it_leaves_objects_a_record_and_a_page(swept: Path) -> None:
    store, out = open_store(swept / "dreams" / "store"), swept / "dreams"
    found = records(store)
    assert [record.inputs["caption"] for record in found] == ["a red mushroom", "a blue house"]
    assert all(record.values["scores"]["embedded-judge"]["pool"] == 3 for record in found), "its own captions are the pool"
    (page,) = out.glob("*.html")
    text = page.read_text()
    assert TRUTHS in text and "a blue house" in text and "xyzzy" in text and "turntable.webp" in text
    (record,) = sweeps(store)
    assert [truth["caption"] for truth in record.values["oracle"]] == ["a red mushroom", "a blue house"]
    assert len(list(out.glob("*/mesh.glb"))) == 2 and len(list(out.glob("*/result.json"))) == 2


def test_a_second_call_makes_nothing(again: Path) -> None:
    store = open_store(again / "dreams" / "store")
    before = {key: store.get(key) for key in store.list("artifacts") if "/sweep/" not in key}
    process = sweep(again)
    assert process.end() == 1 and "2 there already, 0 to dream" in process.text(), process.text()
    assert {key: store.get(key) for key in store.list("artifacts") if "/sweep/" not in key} == before


def test_what_was_only_scored_becomes_whole_without_being_dreamed_again(tmp_path: Path) -> None:
    (tmp_path / "captions.txt").write_text("a red mushroom\n")
    process = sweep(tmp_path, "--score-only")
    assert process.end() == 0, process.text()
    store = open_store(tmp_path / "dreams" / "store")
    steps = ("encode", "optimize", "views", "score", "scored")
    first = {key: store.get(key) for step in steps for key in store.list(f"artifacts/{step}")}
    assert len(first) == 5 and not any(store.list(f"artifacts/{step}") for step in ("render", "mesh", "mesh_score", "dream"))
    (scored,) = read_records(store, "scored")
    (said,) = scored.values["scores"].values()
    assert said["learning"]["steps"] == list(range(1, 13)) and len(said["learning"]["ranks"]) == 12 and "mesh" not in said

    process = sweep(tmp_path)
    assert process.end() == 0 and "0 there already, 1 to dream" in process.text(), process.text()
    assert first == {key: store.get(key) for step in steps for key in store.list(f"artifacts/{step}")}, "a step was done again"
    (whole,) = read_records(store, "dream")
    (more,) = whole.values["scores"].values()
    assert {name: more[name] for name in said} == said
    assert more["mesh"]["random"]["pool"] == said["field"]["random"]["pool"] == 153
    process = sweep(tmp_path, "--score-only")
    assert process.end() == 0 and "1 there already, 0 to dream" in process.text(), process.text()


def test_scored_anew_an_object_keeps_its_pictures_and_its_mesh(again: Path) -> None:
    store, out = open_store(again / "dreams" / "store"), again / "dreams"
    meshes = {key: store.get(key) for step in ("render", "mesh") for key in store.list(f"artifacts/{step}")}
    for step in ("score", "mesh_score", "dream"):  # as another judge would find it
        for key in store.list(f"artifacts/{step}"):
            store.delete(key)
    process = sweep(again, "--score-only")
    assert process.end() == 1 and "0 there already, 2 to dream" in process.text(), process.text()
    assert meshes == {key: store.get(key) for step in ("render", "mesh") for key in store.list(f"artifacts/{step}")}
    assert all("mesh" in record.values["scores"]["embedded-judge"] for record in records(store)) and len(records(store)) == 2
    (page,) = out.glob("*.html")
    assert page.read_text().count("/turntable.webp") >= 2


@pytest.mark.skipif(sys.platform != "linux", reason="looks at processes through /proc")
def test_ctrl_c_saves_and_says_how_to_go_on(again: Path) -> None:
    process = sweep(again, "--seeds", "5", "--set", "optim.steps=5000", "--set", "optim.checkpoint_every=5000")
    process.until("[1/2]")
    store = open_store(again / "dreams" / "store")
    runs = set(store.list("runs"))
    wait_for(lambda: len(list((again / "dreams").glob("*/preview.png"))) > 2)
    workers = workers_of(process.process.pid)
    process.process.send_signal(signal.SIGINT)
    assert process.end() == 130, process.text()
    assert "which is saved. To go on, run the same command again:\n  dreamfields sweep" in process.text()
    assert "failed" not in process.text() and len(workers) == 1 and gone(workers[0], within=10)
    (run,) = {key.split("/")[1] for key in set(store.list("runs")) - runs}
    assert latest_checkpoint(store, run) is not None


@pytest.mark.usefixtures("server")
def test_two_dask_workers_give_the_same_digests(swept: Path, tmp_path: Path) -> None:
    out = tmp_path / "dask"
    said: dict[str, Any] = coco_sweep(
        str(swept / "captions.txt"), settings=list(SETTINGS), out=str(out), through="dask", workers=2, seeds=[0]
    )
    assert (said["objects"], said["dreamed"], said["failed"]) == (3, 2, {})
    plain, dask = records(open_store(swept / "dreams" / "store")), records(open_store(out / "store"))
    assert [record.outputs for record in dask] == [record.outputs for record in plain]
    assert [record.values["scores"] for record in dask] == [record.values["scores"] for record in plain]


@pytest.mark.usefixtures("server")
def test_a_night_judges_again_dreams_nothing_and_says_what_is_gone(again: Path) -> None:
    out, store = again / "dreams", open_store(again / "dreams" / "store")
    kept = {key: store.get(key) for step in ("optimize", "mesh", "render", "dream") for key in store.list(f"artifacts/{step}")}
    (first,) = nightly_eval(out=str(out)).values()
    assert (first["objects"], first["gone"], first["fell"], first["lost"]) == (2, {}, [], [])
    store.delete(records(store)[0].output("mesh.glb").key)
    (second,) = nightly_eval(out=str(out), judges=["embedded"]).values()
    assert second["objects"] == 1 and list(second["gone"]) == ["a red mushroom (as preset, seed 0)"] and second["fell"] == []
    assert kept == {key: store.get(key) for step in ("optimize", "mesh", "render", "dream") for key in store.list(f"artifacts/{step}")}
    assert "Since the last night" in next(out.glob("*.html")).read_text()
    assert len(store.list("artifacts/night")) == 2

"""`dreamfields dream`, typed: what it leaves, what it does again, and how it stops."""

from __future__ import annotations

import json
import re
import resource
import signal
import sys
import time
from pathlib import Path

import pytest

from dreamfields_core.meshing import from_glb, provenance_of
from storage.artifacts import ArtifactRef, get_artifact
from storage.checkpoints import latest_checkpoint
from storage.digests import sha256_file
from storage.store import open_store
from tests.flows.conftest import Dreams
from tests.tasks.processes import gone, workers_of

linux = pytest.mark.skipif(sys.platform != "linux", reason="looks at processes through /proc")


def cached(text: str) -> dict[str, bool]:
    """Which steps were done already."""
    return {match[1]: match[2] == "was done already" for match in re.finditer(r"^(\w+): (was done already|[\d.]+ s)$", text, re.MULTILINE)}


def test_it_leaves_what_it_promises(dreamt: Path) -> None:
    folder = next(path for path in dreamt.iterdir() if path.name.startswith("a-red-mushroom-"))
    result = json.loads((folder / "result.json").read_text())
    assert result["caption"] == "a red mushroom" and result["seed"] == 0 and len(result["config_digest"]) == 64
    assert re.fullmatch(r"[\w.]+\+[0-9a-f]{12}", result["code_version"])
    assert result["encoders"]["guidance"]["name"] == "embedded" and result["encoders"]["judge"]["name"] == "embedded-judge"
    assert result["encoders"]["same_model"] is False
    assert set(result["seconds"]) == {"encode", "optimize", "views", "render", "mesh", "score", "mesh_score"}
    score = result["scores"]["embedded-judge"]
    assert {"cosine", "rank", "correct", "pool"} <= score.keys() and score["pool"] == 153 and 1 <= score["rank"] <= 153
    assert len(score["mesh"]["random"]["ranks"]) == 4
    kept = {path.name: path for path in folder.iterdir()}
    films = {"turntable.mp4", "turntable_depth.mp4", "turntable_transmittance.mp4", "mesh_turntable.mp4"}
    assert {"mesh.glb", "contact_sheet.png", "preview.png", "result.json", "view.html", *films} <= kept.keys()
    for ref in map(ArtifactRef.from_json, result["artifacts"]):
        assert len(get_artifact(open_store(dreamt / "store"), ref)) == ref.size
        assert ref.name not in kept or sha256_file(kept[ref.name]) == ref.sha256
    mesh = (folder / "mesh.glb").read_bytes()
    assert provenance_of(mesh)["caption"] == "a red mushroom" and provenance_of(mesh)["guidance"] == result["encoders"]["guidance"]
    assert 0 < len(from_glb(mesh).faces) <= 800


def test_a_second_call_does_nothing_and_says_so(again: Dreams) -> None:
    begun = time.monotonic()
    text, _, _ = again.dream()
    assert time.monotonic() - begun < 10
    assert all(cached(text).values()) and len(cached(text)) == 7
    assert "everything was there already" in text


def test_a_change_of_the_mesh_leaves_the_field(again: Dreams) -> None:
    text, result, _ = again.dream("--set", "mesh.faces=500")
    assert {name for name, known in cached(text).items() if not known} == {"mesh", "mesh_score"}
    assert result["mesh"]["mesh"]["faces"] <= 500


def test_a_deleted_artifact_is_made_again(again: Dreams, dreamt: Path) -> None:
    before = json.loads(next(dreamt.glob("*/result.json")).read_text())
    field = ArtifactRef.from_json(next(ref for ref in before["artifacts"] if ref["name"] == "field.safetensors"))
    open_store(again.out / "store").delete(field.key)
    text, result, _ = again.dream()
    assert {name for name, known in cached(text).items() if not known} == {"optimize"}
    assert "field.safetensors, made by optimize, is missing" in text
    assert result["artifacts"] == before["artifacts"]


def test_another_store_holds_the_same(dreams: Dreams, dreamt: Path) -> None:
    before = json.loads(next(dreamt.glob("*/result.json")).read_text())
    _, result, _ = dreams.dream()
    assert result["scores"] == before["scores"]
    assert result["artifacts"] == before["artifacts"]


@linux
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_saves_the_step_it_stops_at(dreams: Dreams, number: signal.Signals, code: int) -> None:
    process = dreams.start("--set", "optim.steps=1000", "--set", "optim.checkpoint_every=1000")
    process.until("optimize 100/1000")
    workers = workers_of(process.process.pid)
    process.process.send_signal(number)
    assert process.end() == code, process.text()
    stopped = re.search(r"Stopped at step (\d+) of 1000, which is saved.*:\n  dreamfields dream 'a red mushroom' ", process.text())
    assert stopped, process.text()
    store = open_store(dreams.out / "store")
    checkpoint = latest_checkpoint(store, store.list("runs")[0].split("/")[1])
    assert checkpoint is not None and checkpoint.step == int(stopped[1]) >= 100
    assert len(workers) == 1 and gone(workers[0], within=5)
    assert list(dreams.out.glob("a-red-mushroom-*/preview.png"))


@linux
def test_a_signal_when_nothing_can_be_lost_ends_at_once(again: Dreams) -> None:
    process = again.start("--set", "evaluate.turntable_frames=300", "--set", "evaluate.picture_size=256")
    process.until("optimize: was done already")
    begun = time.monotonic()
    process.process.send_signal(signal.SIGINT)
    assert process.end() == 130 and time.monotonic() - begun < 5, process.text()
    assert "To go on, run the same command again" in process.text()


@linux
def test_a_full_disk_is_one_sentence(dreams: Dreams) -> None:
    """A limit on the size of files stands for the disk: what is small goes on being written, a checkpoint does not."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        process = dreams.start()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert process.end() == 1, process.text()
    assert "Traceback" not in process.text()
    assert re.match(r"dreamfields: .*(full|room|space|large)", process.lines[-1]), process.text()


@pytest.mark.slow
def test_an_object_store_holds_the_same_and_resumes(dreams: Dreams, dreamt: Path, s3: str) -> None:
    process = dreams.start("--store", f"{s3}/dreams")
    process.until("optimize 6/12")
    process.kill()
    text, result, _ = dreams.dream("--store", f"{s3}/dreams")
    before = json.loads(next(dreamt.glob("*/result.json")).read_text())
    assert result["artifacts"] == before["artifacts"] and result["scores"] == before["scores"], text

"""The deployment as an operator meets it: a server, a process worker, `prefect deploy --all`, runs that end, are cancelled or die."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterFlowRunId
from prefect.states import Cancelling

from storage.checkpoints import Checkpoint, latest_checkpoint
from storage.store import open_store
from tests.flows.conftest import CAPTION
from tests.flows.records import glb, keep_dream
from tests.flows.site import Site, wait_for
from tests.tasks.processes import gone
from tests.tasks.tiny import SETTINGS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform != "linux", reason="looks at processes through /proc"),
]
ENDLESS = ["optim.steps=200000", "optim.checkpoint_every=199999"]
"""Whatever checkpoint such a run leaves is of the step it was stopped at."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    site = Site(tmp_path_factory.mktemp("site"))
    yield site
    site.close()


def dream_at(site: Site, out: Path, *settings: str) -> UUID:
    """Ask for a dream; its flow run."""
    return site.run("dream/dream", caption=CAPTION, out=str(out), settings=[*SETTINGS, *settings])


def begun(site: Site, out: Path) -> int:
    """Wait until an endless dream is well under way; the process that optimises."""
    wait_for(lambda: list(out.glob("*/preview.png")))
    time.sleep(1)
    return site.optimizers()[0]


def checkpoint(out: Path) -> Checkpoint | None:
    store = open_store(out / "store")
    return latest_checkpoint(store, store.list("runs")[0].split("/")[1])


def artifacts(site: Site, run: UUID) -> list[dict[str, Any]]:
    """What the page of a flow run shows."""
    wanted = ArtifactFilter(flow_run_id=ArtifactFilterFlowRunId(any_=[run])).model_dump(mode="json")
    return list(site.client.request("POST", "/artifacts/filter", json={"artifacts": wanted}).json())


def test_a_run_completes_and_its_page_shows_it(site: Site, tmp_path: Path) -> None:
    run = dream_at(site, tmp_path)
    wait_for(lambda: site.state(run) in ("Completed", "Failed", "Crashed"))
    assert site.state(run) == "Completed"
    shown = artifacts(site, run)
    kinds = {artifact["key"]: artifact["type"] for artifact in shown}
    assert kinds["dream-progress"] == "progress" and kinds["dream-views"] == "image" and kinds["dream-score"] == "table"
    assert next(artifact["data"] for artifact in shown if artifact["key"] == "dream-progress") == 100.0
    assert list(tmp_path.glob("*/mesh.glb"))


def test_a_bad_caption_is_refused_before_a_run(site: Site) -> None:
    before = len(site.runs("dream"))
    asked = site.prefect("deployment", "run", "dream/dream", "--param", "caption=")
    assert asked.returncode != 0
    assert len(site.runs("dream")) == before


def test_a_pull_brings_what_is_stored_and_its_page_lists_it(site: Site, tmp_path: Path) -> None:
    kept = keep_dream(open_store(tmp_path / "store"), mesh=glb())
    run = site.run("pull/pull", store=str(tmp_path / "store"), to=str(tmp_path / "assets"), formats=["glb", "usdz"], min_score=0.2)
    wait_for(lambda: site.state(run) in ("Completed", "Failed", "Crashed"))
    assert site.state(run) == "Completed"
    (about,) = json.loads((tmp_path / "assets" / "manifest.json").read_text())["objects"].values()
    assert about["record"] == kept.key and set(about["files"]) == {"mesh.glb", "mesh.usdz"}
    assert [artifact["key"] for artifact in artifacts(site, run)] == ["pull-changes"]


@pytest.mark.parametrize("wrong", ['formats=["fbx"]', "min_score=2", "seed=-1", 'also=["../escaped"]', "to="])
def test_a_bad_pull_is_refused_before_a_run(site: Site, tmp_path: Path, wrong: str) -> None:
    before = len(site.runs("pull"))
    asked = site.prefect("deployment", "run", "pull/pull", "--param", f"store={tmp_path}", "--param", wrong)
    assert asked.returncode != 0 and len(site.runs("pull")) == before


def test_a_cancel_saves_the_step_it_stops_at(site: Site, tmp_path: Path) -> None:
    run = dream_at(site, tmp_path, *ENDLESS)
    optimizer = begun(site, tmp_path)
    site.client.set_flow_run_state(run, Cancelling())
    assert gone(optimizer, within=90)
    wait_for(lambda: site.state(run) == "Cancelled")
    saved = checkpoint(tmp_path)
    assert saved is not None and saved.step > 10
    assert site.optimizers() == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_the_end_of_the_worker_saves_the_step_it_stops_at(site: Site, tmp_path: Path, number: signal.Signals) -> None:
    run = dream_at(site, tmp_path, *ENDLESS)
    optimizer = begun(site, tmp_path)
    if number == signal.SIGTERM:
        site.worker.send_signal(number)
    else:
        os.kill(_parent(optimizer), number)  # the flow's own process, as a machine out of memory would
    assert gone(optimizer, within=90)
    saved = checkpoint(tmp_path)
    assert saved is not None and saved.step > 10
    assert site.optimizers() == []
    if number == signal.SIGTERM:
        site.worker.wait(60)
        site.worker = site.start_worker()
    assert site.state(run) != "Completed"


def _parent(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])

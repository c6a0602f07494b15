"""The deployment as an operator meets it: a server, a process worker, `prefect deploy --all`, runs that end, are cancelled or die."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from uuid import UUID

import pytest
from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterFlowRunId
from prefect.states import Cancelling

from storage.checkpoints import Checkpoint, latest_checkpoint
from storage.store import open_store
from tests.flows.conftest import CAPTION
from tests.tasks.processes import REPO, gone
from tests.tasks.tiny import SETTINGS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform != "linux", reason="looks at processes through /proc"),
]
ENDLESS = ["optim.steps=200000", "optim.checkpoint_every=199999"]
"""Whatever checkpoint such a run leaves is of the step it was stopped at."""


def wait_for(what: Callable[[], object], seconds: float = 180) -> None:
    """Look until it is so."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, f"{what} never came true"
        time.sleep(0.2)


class Site:
    """A server on the loopback, one worker, and the deployments of prefect.yaml."""

    def __init__(self, home: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.url, self.home = f"http://127.0.0.1:{port}/api", home
        self.env = {
            **os.environ,
            "PREFECT_HOME": str(home),
            "PREFECT_API_URL": self.url,
            "PREFECT_LOGGING_TO_API_ENABLED": "true",
            "PYTHONPATH": str(REPO),
        }
        self._started: list[subprocess.Popen[bytes]] = []
        self._start("server", "start", "--host", "127.0.0.1", "--port", str(port))
        wait_for(self._healthy)
        self.client = SyncPrefectClient(self.url)
        self.prefect("work-pool", "create", "dreams", "--type", "process")
        self.prefect("--no-prompt", "deploy", "--all")
        self.worker = self.start_worker()

    def prefect(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """The command, done."""
        command = [sys.executable, "-m", "prefect", *arguments]
        return subprocess.run(command, env=self.env, cwd=REPO, capture_output=True, text=True, timeout=180)

    def start_worker(self) -> subprocess.Popen[bytes]:
        return self._start("worker", "start", "--pool", "dreams")

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        log = open(self.home / f"{arguments[0]}.log", "ab")
        process = subprocess.Popen([sys.executable, "-m", "prefect", *arguments], env=self.env, cwd=REPO, stdout=log, stderr=log)
        self._started.append(process)
        return process

    def _healthy(self) -> bool:
        with suppress(OSError):
            return bool(json.load(urllib.request.urlopen(f"{self.url}/health")))
        return False

    def run(self, out: Path, *settings: str) -> UUID:
        """Ask for a dream; its flow run."""
        before = {run.id for run in self.client.read_flow_runs()}
        asked = self.prefect(
            "deployment", "run", "dream/dream", "--param", f"caption={CAPTION}", "--param", f"out={out}",
            "--param", "settings=" + json.dumps([*SETTINGS, *settings]),
        )  # fmt: skip
        assert asked.returncode == 0, asked.stderr
        return next(run.id for run in self.client.read_flow_runs() if run.id not in before)

    def state(self, run: UUID) -> str:
        """The name of its state."""
        state = self.client.read_flow_run(run).state
        return state.name if state else ""

    def optimizers(self) -> list[int]:
        """Processes that optimise for this site."""
        found = []
        for process in Path("/proc").iterdir():
            with suppress(OSError):
                if (
                    b"tasks.optimize_worker" in (process / "cmdline").read_bytes()
                    and self.url.encode() in (process / "environ").read_bytes()
                ):
                    found.append(int(process.name))
        return found

    def close(self) -> None:
        for process in reversed(self._started):
            process.terminate()
        for process in self._started:
            process.wait(60)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    site = Site(tmp_path_factory.mktemp("site"))
    yield site
    site.close()


def begun(site: Site, out: Path) -> int:
    """Wait until an endless dream is well under way; the process that optimises."""
    wait_for(lambda: list(out.glob("*/preview.png")))
    time.sleep(1)
    return site.optimizers()[0]


def checkpoint(out: Path) -> Checkpoint | None:
    store = open_store(out / "store")
    return latest_checkpoint(store, store.list("runs")[0].split("/")[1])


def test_a_run_completes_and_its_page_shows_it(site: Site, tmp_path: Path) -> None:
    run = site.run(tmp_path)
    wait_for(lambda: site.state(run) in ("Completed", "Failed", "Crashed"))
    assert site.state(run) == "Completed"
    shown = site.client.request(
        "POST",
        "/artifacts/filter",
        json={"artifacts": ArtifactFilter(flow_run_id=ArtifactFilterFlowRunId(any_=[run])).model_dump(mode="json")},
    ).json()
    kinds = {artifact["key"]: artifact["type"] for artifact in shown}
    assert kinds["dream-progress"] == "progress" and kinds["dream-views"] == "image" and kinds["dream-score"] == "table"
    assert next(artifact["data"] for artifact in shown if artifact["key"] == "dream-progress") == 100.0
    assert list(tmp_path.glob("*/mesh.glb"))


def test_a_bad_caption_is_refused_before_a_run(site: Site) -> None:
    before = len(site.client.read_flow_runs())
    asked = site.prefect("deployment", "run", "dream/dream", "--param", "caption=")
    assert asked.returncode != 0
    assert len(site.client.read_flow_runs()) == before


def test_a_cancel_saves_the_step_it_stops_at(site: Site, tmp_path: Path) -> None:
    run = site.run(tmp_path, *ENDLESS)
    optimizer = begun(site, tmp_path)
    site.client.set_flow_run_state(run, Cancelling())
    assert gone(optimizer, within=90)
    wait_for(lambda: site.state(run) == "Cancelled")
    saved = checkpoint(tmp_path)
    assert saved is not None and saved.step > 10
    assert site.optimizers() == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_the_end_of_the_worker_saves_the_step_it_stops_at(site: Site, tmp_path: Path, number: signal.Signals) -> None:
    run = site.run(tmp_path, *ENDLESS)
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

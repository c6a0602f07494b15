"""An operator's site: a server on the loopback, one worker, and the deployments of prefect.yaml."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.filters import FlowFilter, FlowFilterName
from prefect.client.schemas.objects import FlowRun

from tests.tasks.processes import REPO

LONGEST = 400.0
"""Seconds that anything may take on a busy machine."""


def wait_for(what: Callable[[], object], seconds: float = LONGEST) -> None:
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
        self._port, self._started = port, list[subprocess.Popen[bytes]]()
        try:
            self.server = self.start_server()
            self.client = SyncPrefectClient(self.url)
            self.prefect("work-pool", "create", "dreams", "--type", "process")
            self.prefect("--no-prompt", "deploy", "--all")
            self.worker = self.start_worker()
        except BaseException:
            self.close()
            raise

    def prefect(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """The command, done."""
        command = [sys.executable, "-m", "prefect", *arguments]
        return subprocess.run(command, env=self.env, cwd=REPO, capture_output=True, text=True, timeout=LONGEST)

    def start_server(self) -> subprocess.Popen[bytes]:
        """Over the database that there is."""
        server = self._start("server", "start", "--host", "127.0.0.1", "--port", str(self._port))
        wait_for(self._healthy)
        return server

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

    def run(self, deployment: str, **parameters: Any) -> UUID:
        """Ask for a run of a deployment; its flow run."""
        said = [text for name, value in parameters.items() for text in ("--param", f"{name}={json.dumps(value)}")]
        asked = self.prefect("deployment", "run", deployment, *said)
        assert asked.returncode == 0, asked.stderr
        found = re.search(r"UUID:\s*([0-9a-f-]{36})", asked.stdout)
        assert found, asked.stdout
        return UUID(found[1])

    def runs(self, flow: str) -> list[FlowRun]:
        """Every run of that flow."""
        return self.client.read_flow_runs(flow_filter=FlowFilter(name=FlowFilterName(any_=[flow])))

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

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        """With -9, and with it whatever it has started, as the end of a machine does."""
        for pid in [*descendants(process.pid), process.pid]:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()

    def close(self) -> None:
        for process in reversed(self._started):
            process.terminate()
        for process in self._started:
            try:
                process.wait(60)
            except subprocess.TimeoutExpired:  # on a busy machine a server can take longer than a test should wait
                self.kill(process)


def descendants(pid: int) -> list[int]:
    """Every process that comes of this one; those in sessions of their own too, such as the one that optimises."""
    found: list[int] = []
    with suppress(FileNotFoundError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            for child in map(int, (thread / "children").read_text().split()):
                found += [*descendants(child), child]
    return found

"""Commands in processes of their own, watched through what they print, and never left behind."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

REPO = Path(__file__).resolve().parents[2]
LONGEST = 240.0
"""Seconds that any of them may take on a busy machine."""


class Process:
    """`python -m module arguments`; its lines are read as they come."""

    def __init__(self, module: str, *arguments: str) -> None:
        self.lines: list[str] = []
        self._ended = False
        self._fresh: queue.Queue[str | None] = queue.Queue()
        path = os.pathsep.join([str(REPO), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            # Small programs too are kept compiled, as the project does for its users.
            env={**os.environ, "PYTHONPATH": path, "PYTHONUNBUFFERED": "1", "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._fresh.put(line)
        self._fresh.put(None)

    def next(self, seconds: float = LONGEST) -> str | None:
        """The next line; None at the end, or when none comes in time."""
        if self._ended:
            return None
        try:
            line = self._fresh.get(timeout=max(seconds, 0.0))
        except queue.Empty:
            return None
        if line is None:
            self._ended = True
        else:
            self.lines.append(line)
        return line

    def until(self, word: str) -> str:
        """The first line with this word in it."""
        while (line := self.next()) is not None:
            if word in line:
                return line
        raise AssertionError(f"{word!r} never came: {''.join(self.lines)}")

    def for_seconds(self, seconds: float) -> None:
        """Read for so long."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and self.next(end - time.monotonic()) is not None:
            pass

    def end(self) -> int:
        """Read everything; the exit code."""
        while self.next() is not None:
            pass
        return self.process.wait(LONGEST)

    def events(self, kind: str) -> list[dict[str, Any]]:
        """The events of that kind among its lines."""
        found = [json.loads(line) for line in self.lines if line.startswith("{") and line.endswith("}\n")]
        return [event for event in found if event["event"] == kind]

    def text(self) -> str:
        return "".join(self.lines)

    def kill(self) -> None:
        """With -9, whatever it is doing."""
        self.process.kill()
        self.process.wait()


def alive(pid: int) -> bool:
    """Whether that process runs; one that waits to be reaped does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def gone(pid: int, *, within: float) -> bool:
    """Whether that process ends in time."""
    end = time.monotonic() + within
    while alive(pid):
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def workers_of(pid: int) -> list[int]:
    """Its children that optimise."""
    children = [child for thread in Path(f"/proc/{pid}/task").iterdir() for child in (thread / "children").read_text().split()]
    return [int(child) for child in children if "optimize_worker" in Path(f"/proc/{child}/cmdline").read_text()]

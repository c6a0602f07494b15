"""A long step in a process of its own: started, listened to, stopped so that it can save.

The child talks JSON lines on its standard output. It is told to stop by SIGTERM, and knows by itself when its parent is gone
(tasks/mortality.py), so that no way of ending the parent leaves it running. Nothing else is ever stopped.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from tasks.large_pages import with_large_pages

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 60.0
"""Seconds that a child has for saving, once it is told to end, before it is killed."""

Event = dict[str, Any]


class ChildError(RuntimeError):
    """The child ended without saying how; its text is one sentence with the last words it wrote."""


class Child:
    """A running `python -m module`, given `job` as its first line of input."""

    def __init__(self, module: str, job: dict[str, Any]) -> None:
        self._module = module
        self._deadline: threading.Timer | None = None
        self._words = tempfile.TemporaryFile(mode="w+", errors="replace")
        self._process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            text=True,
            cwd=Path.cwd(),
            env=with_large_pages({**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}),
            start_new_session=True,
        )
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it is gone already: `events` says so
            self._process.stdin.write(json.dumps({**job, "parent": os.getpid()}) + "\n")
            self._process.stdin.flush()

    def events(self) -> Iterator[Event]:
        """What it says, until it ends.

        Raises:
          ChildError: it ended with an exit code other than 0.
        """
        assert self._process.stdout is not None
        for line in self._process.stdout:
            yield json.loads(line)
        code = self._process.wait()
        if code != 0:
            raise ChildError(self._obituary(code))

    @property
    def told_to_end(self) -> bool:
        """Whether `terminate` has been called while it ran."""
        return self._deadline is not None

    def terminate(self) -> None:
        """Ask it to save and end; `events` go on until it has, or its time is over and it is killed."""
        if self._process.poll() is None:
            if self._deadline is None:
                self._deadline = threading.Timer(PATIENCE, self._process.kill)
                self._deadline.daemon = True
                self._deadline.start()
            self._process.terminate()

    def stop(self) -> Event | None:
        """Ask it to save and end, and wait until it has; the last thing it said."""
        self.terminate()
        last = self._drain()
        self.close()
        return last

    def close(self) -> None:
        """Wait for the end; a child that does not come to it is killed."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._deadline:
            self._deadline.cancel()
        self._process.stdout.close()
        self._words.close()

    def _drain(self) -> Event | None:
        assert self._process.stdout is not None
        last = None
        for line in self._process.stdout:
            last = json.loads(line)
        return last

    def _obituary(self, code: int) -> str:
        self._words.seek(0)
        words = [line.strip() for line in self._words.read().splitlines() if line.strip()]
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        hint = " (out of memory, perhaps: try a smaller render.skip.chunk)" if code == -signal.SIGKILL and not self.told_to_end else ""
        last = f', its last words: "{words[-1][:300]}"' if words else ""
        return f"expected {self._module} to finish, but it {how}{hint}{last}: the same command goes on from its last checkpoint"

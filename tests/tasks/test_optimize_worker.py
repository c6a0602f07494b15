"""What the optimising process must be before it watches for signals, and what may go wrong in it without harm."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tasks.optimize_worker import Previews


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted as Linux shows them")
def test_nothing_begins_a_thread_before_the_signals_are_watched() -> None:
    """A thread from before would take SIGTERM in its default way: the process would end with nothing saved."""
    count = "import os, tasks.optimize_worker; print(len(os.listdir('/proc/self/task')))"
    done = subprocess.run([sys.executable, "-c", count], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "1"


def test_a_preview_that_cannot_be_written_is_told_once_and_costs_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    said: list[tuple[str, dict[str, Any]]] = []
    tell: Any = lambda event, **facts: said.append((event, facts))  # noqa: E731
    previews = Previews(tmp_path / "file" / "preview.png", tell)
    dreamer = SimpleNamespace(program=SimpleNamespace(preview=lambda state: np.zeros((4, 4, 3), np.uint8)), state=None)
    for _ in range(3):
        previews.show(dreamer)
    ((event, facts),) = said
    assert event == "note" and facts["text"].startswith("no more previews: ")

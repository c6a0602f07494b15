"""What the optimising process must be before it watches for signals."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted as Linux shows them")
def test_nothing_begins_a_thread_before_the_signals_are_watched() -> None:
    """A thread from before would take SIGTERM in its default way: the process would end with nothing saved."""
    count = "import os, tasks.optimize_worker; print(len(os.listdir('/proc/self/task')))"
    done = subprocess.run([sys.executable, "-c", count], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "1"

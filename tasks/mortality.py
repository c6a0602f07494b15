"""How a child process learns that it should end: a signal, or the death of its parent."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable

_PR_SET_PDEATHSIG = 1
SIGNALS = (signal.SIGTERM, signal.SIGINT)


class StopSign:
    """Raised once, by SIGTERM, SIGINT or the end of the parent; asked between two units of work.

    A thread waits for the signals, so that they are noticed during long compiled calls too. `impatient` is called at once,
    on that thread: it may end the process when there is nothing to save.
    """

    def __init__(self, impatient: Callable[[], None]) -> None:
        self._raised = threading.Event()
        self._impatient = impatient

    def __bool__(self) -> bool:
        return self._raised.is_set()

    def watch(self, parent: int) -> None:
        """Start watching. To be called on the main thread before any other thread begins, since threads inherit the mask."""
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        threading.Thread(target=self._await_signal, daemon=True).start()
        threading.Thread(target=self._await_silence, daemon=True).start()
        _end_with_parent()
        if os.getppid() != parent:
            self.raise_()

    def raise_(self) -> None:
        self._raised.set()
        self._impatient()

    def _await_signal(self) -> None:
        signal.sigwait(SIGNALS)
        self.raise_()

    def _await_silence(self) -> None:
        sys.stdin.read()  # the parent holds the other end open as long as it lives
        self.raise_()


def _end_with_parent() -> None:
    """On Linux the kernel sends SIGTERM when the thread that started this process is gone; elsewhere the closed input tells."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)

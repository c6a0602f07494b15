"""Work beside the thread that asked for it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Result = TypeVar("Result")
GLANCE = 0.2
"""Seconds between two looks: a signal is noticed in between on every system."""


class Beside(Generic[Result]):
    """A function at work on a thread that does not outlive the process."""

    def __init__(self, work: Callable[[], Result]) -> None:
        self._results: list[Result] = []
        self._error: BaseException | None = None
        # An event, since a join that a signal interrupts takes the thread for ended.
        self._ended = threading.Event()
        threading.Thread(target=self._run, args=(work,), daemon=True).start()

    def _run(self, work: Callable[[], Result]) -> None:
        try:
            self._results.append(work())
        except BaseException as error:  # raised again where the result is asked for
            self._error = error
        finally:
            self._ended.set()

    def wait(self) -> None:
        """Until it has ended, one way or the other."""
        while not self._ended.wait(GLANCE):
            pass

    def result(self) -> Result:
        """Wait for it. Raises: what it raised."""
        self.wait()
        if self._error is not None:
            raise self._error
        return self._results[0]

"""How often something is told: who hears an event many times a second passes on one now and then."""

from __future__ import annotations

import time


class Pace:
    """Says yes at most once in so many seconds.

    seconds: between two times. at_once: the first time may be now; else it comes after `seconds` too.
    """

    def __init__(self, seconds: float, *, at_once: bool = True) -> None:
        self._seconds = seconds
        self._due = time.monotonic() + (0.0 if at_once else seconds)

    def is_due(self, *, anyway: bool = False) -> bool:
        """Whether it is time again, or told `anyway`; after a yes the seconds begin anew."""
        now = time.monotonic()
        if now < self._due and not anyway:
            return False
        self._due = now + self._seconds
        return True

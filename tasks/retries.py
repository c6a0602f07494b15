"""What is worth another try: a store or a network that did not answer, a child process that died. Refusals never are."""

from __future__ import annotations

from storage.errors import StoreUnreachable
from storage.published import NoNetwork
from tasks.child import ChildError
from tasks.optimize import OptimizeInterrupted

DELAYS = (10.0, 60.0)
"""Seconds before the second try and the third, the last."""
PASSING = (StoreUnreachable, NoNetwork, ChildError, OptimizeInterrupted, ConnectionError, TimeoutError)


def is_passing(error: object) -> bool:
    """Whether the error, or one that it was made of, may be gone at the next try."""
    while isinstance(error, BaseException):
        if isinstance(error, PASSING):
            return True
        error = error.__cause__
    return False

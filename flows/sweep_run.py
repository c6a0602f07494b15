"""The objects of a sweep one after the other: what fails is written down and the rest goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from flows.order import Order
from flows.recipe import Plainly
from flows.result import fulfil
from flows.sweep_plan import Cell
from storage.store import open_store
from tasks.optimize import OptimizeStopped
from tasks.retries import DELAYS, is_passing
from tasks.step import Place


def run_cells(cells: Sequence[Cell], make: Callable[[Cell], Any], failed: Callable[[Cell, str], None]) -> None:
    """Make every object; `failed` hears of each that could not be made. Who asks the work to stop stops it all.

    Raises: OptimizeStopped.
    """
    for cell in cells:
        try:
            make(cell)
        except OptimizeStopped:
            raise
        except Exception as error:
            failed(cell, sentence(error))


def sentence(error: BaseException) -> str:
    """What is written down of an error."""
    return str(error) or type(error).__name__


def make_plainly(order: Order, place: Place) -> dict[str, Any]:
    """One object without a conductor; what result.json says. Raises: whatever a step raises."""
    return fulfil(order, Plainly(place, order.config), place.store)


def persistently(work: Callable[[], Any], tell: Callable[[str], None], *, delays: Sequence[float] = DELAYS) -> Any:
    """The work, tried again after a while where a store, a network or a child process was to blame. Raises: what it raises last."""
    for delay in delays:
        try:
            return work()
        except Exception as error:
            if not is_passing(error):
                raise
            tell(f"{sentence(error)}; again in {delay:.0f} s")
            time.sleep(delay)
    return work()


def place_of(order: Order, **more: Any) -> Place:
    """Where the object of an order is made."""
    return Place(open_store(order.store), preview=order.folder / "preview.png", **more)

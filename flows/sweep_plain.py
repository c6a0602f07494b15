"""A sweep without any server, shown in the terminal."""

from __future__ import annotations

import os
import shlex
import signal
import sys
import time
from collections import Counter
from typing import Any

from rich.console import Console

from flows.beside import Beside
from flows.display import Display
from flows.exits import INTERRUPTED, TERMINATED
from flows.plain import Terminated, notes, terminable
from flows.report import write_page
from flows.sweep_oracle import oracle_of
from flows.sweep_plan import Cell, Plan
from flows.sweep_record import entries, keep_sweep, missing
from flows.sweep_report import page_of, report_of
from flows.sweep_run import make_plainly, persistently, run_cells
from storage.store import open_store
from tasks.step import Event, Place, StopRequest


class Sweep:
    """A plan being carried out: which cell it is at, what has failed, how long it may take."""

    def __init__(self, plan: Plan, console: Console) -> None:
        self.plan, self.store, self.stop = plan, open_store(plan.store), StopRequest()
        self.errors: dict[str, str] = {}
        self.step: int | None = None
        self._console, self._display = console, Display(console, steps=1)
        self._done, self._begun = 0, time.monotonic()
        with notes(self.hear):
            self.waiting = missing(plan, self.store)

    def carry_out(self) -> None:
        """Dream what is missing, one object after the other."""
        self._begun = time.monotonic()
        run_cells(self.waiting, self._make, self._fail)

    def hear(self, event: Event) -> None:
        """An event of a step: the bar where there is a terminal, elsewhere only what is out of the ordinary."""
        if event["event"] in ("step", "stopped"):
            self.step = event["step"] or self.step
        if self._console.is_terminal or event["event"] not in ("step", "end", "stopped"):
            self._display(event)

    def say(self, text: str) -> None:
        """A line."""
        self._console.print(text, markup=False, soft_wrap=True)

    def _make(self, cell: Cell) -> None:
        assert cell.order is not None
        order, self.step, begun = cell.order, None, time.monotonic()
        self.say(f"[{self._done + 1}/{len(self.waiting)}] {cell.name}")
        place = Place(self.store, self.hear, order.folder / "preview.png", self.stop)
        with Display(self._console, steps=order.config.optim.steps) as self._display:
            result = persistently(lambda: make_plainly(order, place), self.say)
        self._done += 1
        first = result["scores"][order.config.evaluate.judge]
        self.say(f"  rank {first['rank']} of {first['pool']}, {time.monotonic() - begun:.0f} s, {self._left()}")

    def _fail(self, cell: Cell, text: str) -> None:
        self._done += 1
        self.errors[cell.key or ""] = text
        self.say(f"  failed: {text}")

    def _left(self) -> str:
        minutes = (time.monotonic() - self._begun) / self._done * (len(self.waiting) - self._done) / 60
        return f"about {minutes:.0f} min left" if minutes >= 1 else "less than a minute left"


def sweep_plainly(plan: Plan) -> int:
    """Dream what is missing of the sweep and write its report; the exit code: 1 where an object could not be dreamed.

    Raises: StorageError.
    """
    console = Console(highlight=False)
    sweep = Sweep(plan, console)
    refused = [cell for cell in plan.cells if cell.error]
    there = len(plan.cells) - len(refused) - len(sweep.waiting)
    sweep.say(f"{plan.name}: {len(plan.cells)} objects, {there} there already, {len(sweep.waiting)} to dream, {len(refused)} refused")
    keep_sweep(plan, sweep.store)
    working: Beside[None] = Beside(sweep.carry_out)
    try:
        with terminable(), notes(sweep.hear):
            working.wait()
    except (KeyboardInterrupt, Terminated) as how:
        _stop(sweep, working)
        os._exit(INTERRUPTED if isinstance(how, KeyboardInterrupt) else TERMINATED)
    working.result()
    record = keep_sweep(plan, sweep.store, sweep.errors, oracle_of(plan, Place(sweep.store, sweep.hear)))
    page = write_page(report_of(record, list(entries(record, sweep.store, plan.out))), page_of(record, plan.out))
    failures = Counter([cell.error for cell in refused] + list(sweep.errors.values()))
    for text, count in failures.items():
        sweep.say(f"{count} could not be dreamed: {text}")
    sweep.say(f"report         {page}")
    return 1 if failures else 0


def _stop(sweep: Sweep, working: Beside[Any]) -> None:
    """Have the long step saved, and say how to go on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    if sweep.stop.request():
        sweep.say("stopping: saving a checkpoint ...")
        working.wait()
    at = f" at step {sweep.step}, which is saved" if sweep.step else ""
    sweep.say(f"Stopped{at}. To go on, run the same command again:\n  {shlex.join(['dreamfields', *sys.argv[1:]])}")
    sys.stdout.flush()

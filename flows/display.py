"""How far a dream has come, in a terminal or, where there is none, in a line now and then."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn

from flows.pace import Pace
from tasks.step import Event

LINES = 10
"""Printed in all for the optimisation, where nothing can be redrawn."""
SECONDS = 10.0
"""Between two lines about the mesh there."""


class Display:
    """Hears every event of the steps; usable from any thread."""

    def __init__(self, console: Console, *, steps: int) -> None:
        self.steps, self.step, self.saved = steps, 0, 0
        self._console = console
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[numbers]}"),
            console=console,
            disable=not console.is_terminal,
        )
        self._bar: TaskID | None = None
        self._asking: TaskID | None = None
        self._pace = Pace(SECONDS, at_once=False)
        self._first: tuple[int, float] | None = None

    def __enter__(self) -> Display:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Stop redrawing."""
        self._progress.stop()

    def __call__(self, event: Event) -> None:
        """Show one event; those that are not for people are passed over."""
        shown = getattr(self, f"_on_{event['event']}", None)
        if shown is not None:
            shown(event)

    def _on_step(self, event: Event) -> None:
        self.step, now = event["step"], time.monotonic()
        if self._first is None:
            self._first = (self.step, now)
        numbers = f"loss {event['loss']:.3f}  transmittance {event['transmittance']:.2f}  {self._left(now)}"
        if self._bar is None:
            self._bar = self._progress.add_task("optimize", total=self.steps, numbers=numbers)
        self._progress.update(self._bar, completed=self.step, numbers=numbers)
        if not self._console.is_terminal and self.step % max(1, self.steps // LINES) == 0:
            self._say(f"optimize {self.step}/{self.steps}  {numbers}")

    def _left(self, now: float) -> str:
        assert self._first is not None
        taken, spent = self.step - self._first[0], now - self._first[1]
        if taken < 2:
            return "time left unknown"
        minutes, seconds = divmod(round(spent / taken * (self.steps - self.step)), 60)
        return f"{minutes}:{seconds:02d} left"

    def _on_asked(self, event: Event) -> None:
        """How many are left nobody knows before the surface is found, so the bar only moves."""
        points = event["points"]
        if self._asking is None:
            self._asking = self._progress.add_task("mesh", total=None, numbers="points asked")
        self._progress.update(self._asking, completed=points)
        if not self._console.is_terminal and self._pace.is_due():
            self._say(f"mesh: {points:,} points asked")

    def _on_end(self, event: Event) -> None:
        if event["name"] == "mesh" and self._asking is not None:
            self._progress.remove_task(self._asking)
            self._asking = None
        self._say(f"{event['name']}: " + ("was done already" if event["cached"] else f"{event['seconds']:.1f} s"))

    def _on_note(self, event: Event) -> None:
        self._say(event["text"])

    def _on_resumed(self, event: Event) -> None:
        self.step = self.saved = event["step"]
        self._say(f"optimize: goes on from the checkpoint of step {event['step']}")

    def _on_rolled_back(self, event: Event) -> None:
        self._say(f"optimize: step {event['step']} was not finite; back to step {event['to']} with {event['rate_scale']:g} times the rate")

    def _on_saved(self, event: Event) -> None:
        self.saved = event["step"]

    def _on_stopped(self, event: Event) -> None:
        self.saved = event["step"] or self.saved

    def _say(self, sentence: str) -> None:
        self._console.print(sentence, markup=False, soft_wrap=True)

"""One dream without any server, shown in the terminal."""

from __future__ import annotations

import logging
import os
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from rich.console import Console

from flows.beside import Beside
from flows.display import Display
from flows.exits import INTERRUPTED, TERMINATED
from flows.order import Order
from flows.recipe import Dream, Plainly, make_object
from flows.result import leave
from storage.store import open_store
from tasks.step import Event, Place


class Terminated(BaseException):
    """SIGTERM."""


def dream_plainly(order: Order) -> int:
    """Dream, show how it goes, and say where everything is; the exit code.

    The work is done on a thread of its own and the main thread only waits: a signal is then never swallowed by a library
    that happens to be running, and what works for the longest is asked to save.

    Raises: whatever a step raises.
    """
    console = Console(highlight=False)
    begun = time.monotonic()
    if order.unknown_words:
        unknown, guide = ", ".join(order.unknown_words), order.config.guidance.name
        console.print(f"{guide} does not know: {unknown}; its language is small (see README), published models know more", soft_wrap=True)
    with Display(console, steps=order.config.optim.steps) as display, notes(display):
        place = Place(open_store(order.store), display, order.folder / "preview.png")
        dreaming: Beside[Dream] = Beside(lambda: make_object(Plainly(place, order.config), order.caption, order.config))
        try:
            with terminable():
                dreaming.wait()
        except (KeyboardInterrupt, Terminated) as how:
            _stop(console, display, place, dreaming)
            # Not by way of the interpreter's end: threads that compute in native code would crash it.
            os._exit(INTERRUPTED if isinstance(how, KeyboardInterrupt) else TERMINATED)
        dream = dreaming.result()
        result = leave(order, dream, place.store)
    _tell(console, order, result, all_cached=all(done.cached for done in dream.steps), seconds=time.monotonic() - begun)
    return 0


@contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM is raised on the main thread, as Ctrl-C is."""

    def raise_terminated(number: int, frame: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, raise_terminated)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _stop(console: Console, display: Display, place: Place, dreaming: Beside[Dream]) -> None:
    """Have the long step saved, and say how to go on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # it is saving: impatience would only lose steps
    if place.stop.request():
        display({"event": "note", "text": "stopping: saving a checkpoint ..."})
        dreaming.wait()
    display.close()
    seen = f"at step {display.step} of {display.steps}, with nothing saved" if display.step else "before the first step"
    at = f"at step {display.saved} of {display.steps}, which is saved" if display.saved else seen
    console.print(f"Stopped {at}. To go on, run the same command again:\n  {shlex.join(['dreamfields', *sys.argv[1:]])}", soft_wrap=True)
    sys.stdout.flush()


@contextmanager
def notes(display: Callable[[Event], None]) -> Iterator[None]:
    """What the storage warns of (something vanished or was damaged) is shown as a sentence."""

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            display({"event": "note", "text": record.getMessage()})

    handler, storage = Handler(logging.WARNING), logging.getLogger("storage")
    storage.addHandler(handler)
    try:
        yield
    finally:
        storage.removeHandler(handler)


def _tell(console: Console, order: Order, result: dict[str, Any], *, all_cached: bool, seconds: float) -> None:
    score = result["scores"][order.config.evaluate.judge]
    mesh_score = score["mesh"]["random"]
    counts = result["mesh"]["mesh"]
    closed = "closed" if counts["watertight"] else "not closed"
    lines = [
        f"mesh           {order.folder / 'mesh.glb'} ({counts['faces']} faces, {closed})",
        f"in 3D          {order.folder / 'view.html'} (opens in any browser, needs no network)",
        f"contact sheet  {order.folder / 'contact_sheet.png'}",
        f"turntable      {order.folder / 'turntable.mp4'}",
        f"all the facts  {order.folder / 'result.json'}",
        f"score          {order.config.evaluate.judge} ranks the caption {_of(score)} from the field, {_of(mesh_score)} from the mesh "
        f"(cosine {score['cosine']:.3f} and {mesh_score['similarity']:.3f})",
        "seconds        " + ", ".join(f"{name} {spent:.1f}" for name, spent in result["seconds"].items()),
    ]
    if result["encoders"]["same_model"]:
        lines.append("note           the judge is the model that guided: the score flatters")
    if all_cached:
        lines.append(f"note           everything was there already (this call took {seconds:.1f} s)")
    console.print("\n".join(lines), soft_wrap=True, markup=False)


def _of(score: dict[str, Any]) -> str:
    return f"{score['rank']} of {score['pool']}"

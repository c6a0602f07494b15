"""The process in which a field is optimised: `python -m tasks.optimize_worker`, a job on its input, JSON lines on its output.

It ends by itself when it is done, told to stop (tasks/mortality.py), or left alone, and saves a checkpoint of the step it
stopped at first.

Libraries that begin threads as they are imported (NumPy's do) are imported only once the signals are watched: a thread from before
would take a signal in its default way, which ends the process with nothing saved.
"""

from __future__ import annotations

import io
import json
import logging
import math
import os
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from tasks.mortality import StopSign

if TYPE_CHECKING:
    from tasks.step import Event

PREVIEW_SECONDS = 4.0
"""At least so long between two previews, and twenty times what one costs."""


class Speech:
    """JSON lines for the parent; nothing else reaches that stream. Usable from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stream: TextIO = os.fdopen(os.dup(1), "w")
        os.dup2(2, 1)  # what libraries print goes to the errors

    def __call__(self, event: str, **facts: Any) -> None:
        try:
            with self._lock:
                self._stream.write(json.dumps({"event": event, **facts}) + "\n")
                self._stream.flush()
        except BrokenPipeError:
            pass  # the parent is gone: the stop sign says so too


class Warnings(logging.Handler):
    """What the storage warns of, told to the user."""

    def __init__(self, tell: Speech) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        self._tell("note", text=record.getMessage())


class Previews:
    """A picture on disk, renewed now and then while the field takes shape; one that cannot be written is told of, and is the last."""

    def __init__(self, path: Path | None, tell: Speech) -> None:
        self._path, self._tell = path, tell
        self._due = 0.0 if path else float("inf")

    def show(self, dreamer: Any) -> None:
        """Renew it, if it is time."""
        begun = time.monotonic()
        if begun < self._due or self._path is None:
            return
        from dreamfields_core.png import png
        from storage.errors import StorageError
        from storage.local import write_file

        try:
            write_file(self._path, png(dreamer.program.preview(dreamer.state)))
        except StorageError as error:
            self._due = float("inf")
            self._tell("note", text=f"no more previews: {error}")
            return
        now = time.monotonic()
        self._due = now + max(PREVIEW_SECONDS, 20 * (now - begun))
        self._tell("preview", path=str(self._path))


def main() -> int:
    """Do the job on the first line of input; exit codes: 0 done or stopped, 1 failed with a `failed` event."""
    job = json.loads(sys.stdin.readline())
    tell = Speech()
    tell("started", pid=os.getpid())
    logging.getLogger("storage").addHandler(Warnings(tell))
    ready = threading.Event()

    def leave_at_once() -> None:
        if not ready.is_set():  # compiling, or reading: there is nothing to save
            tell("stopped", step=None)
            os._exit(0)

    stop = StopSign(leave_at_once)
    stop.watch(job["parent"])
    try:
        _optimize(job, tell, stop, ready)
    except Exception as error:
        from tasks.retries import is_passing

        tell("failed", passing=is_passing(error), text=str(error) or type(error).__name__)
        return 1
    return 0


def _optimize(job: Event, tell: Speech, stop: StopSign, ready: threading.Event) -> None:
    from storage.locks import step_lock
    from storage.store import open_store

    store = open_store(job["store"])
    with step_lock(store, f"worker-{job['run']}", on_wait=lambda sentence: tell("note", text=sentence)):
        dreamer = _dreamer(job, store, tell)
        previews = Previews(Path(job["preview"]) if job["preview"] else None, tell)
        while not dreamer.finished and not stop:
            dreamer.advance()
            ready.set()
            previews.show(dreamer)
        if not dreamer.finished:
            dreamer.stop()
            tell("stopped", step=dreamer.step)
            return
        ready.set()
        dreamer.close()
        tell("done", **_results(dreamer, store))


def _dreamer(job: Event, store: Any, tell: Speech) -> Any:
    from tasks.compiled import keep_compiled

    keep_compiled()
    import jax.numpy as jnp
    import numpy as np

    from dreamfields_core.config import validate
    from dreamfields_core.dreaming.program import DreamProgram
    from storage.artifacts import ArtifactRef, get_artifact
    from tasks.dreamer import Dreamer
    from tasks.encoders import load_encoder

    config = validate(job["config"])
    embedding = np.load(io.BytesIO(get_artifact(store, ArtifactRef.from_json(job["text_embedding"]))), allow_pickle=False)
    program = DreamProgram(config, load_encoder(config.guidance.name, towers=("image",)))
    return Dreamer(program, jnp.asarray(embedding), store, job["run"], tell)


def _results(dreamer: Any, store: Any) -> Event:
    """The files that the step gives, and its last numbers."""
    import numpy as np

    from dreamfields_core.png import png
    from storage.artifacts import put_artifact
    from tasks.finished_field import MEDIA_TYPE, pack_field

    history, glimpses = io.BytesIO(), io.BytesIO()
    np.savez(history, **{name: np.asarray([row[name] for row in dreamer.history], np.float32) for name in dreamer.history[0]})  # type: ignore[arg-type]
    seen = dreamer.glimpses
    if dreamer.step not in seen:
        seen = seen | {dreamer.step: dreamer.program.glimpse(dreamer.state)}
    np.savez(glimpses, steps=np.asarray(list(seen)), pictures=np.stack(list(seen.values())))
    arrays = dreamer.arrays()
    outputs = [
        put_artifact(store, "field.safetensors", pack_field(arrays, dreamer.config), MEDIA_TYPE),
        put_artifact(store, "history.npz", history.getvalue(), "application/x-npz"),
        put_artifact(store, "glimpses.npz", glimpses.getvalue(), "application/x-npz"),
        put_artifact(store, "preview.png", png(dreamer.program.preview(dreamer.state)), "image/png"),
    ]
    last = {name: value if math.isfinite(value) else None for name, value in dreamer.history[-1].items()}
    values = {"steps": dreamer.step, "rate_scale": float(arrays["rate_scale"]), "last": last}
    return {"outputs": [ref.to_json() for ref in outputs], "values": values, "seconds": dreamer.seconds}


if __name__ == "__main__":
    sys.exit(main())

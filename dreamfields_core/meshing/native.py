"""Native libraries in processes of their own: arrays in, arrays out, and a crash costs one call and one sentence."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dreamfields_core.meshing.errors import MeshCleaningFailed

Arrays = Mapping[str, np.ndarray]

INCOMPLETE = 3
"""Exit status of a worker whose library is not whole; its last line says what to install."""


def worker(file: str) -> tuple[str, ...]:
    """The command of a worker in this folder. -P: the folder must not come first among the places that modules are looked for in."""
    return (sys.executable, "-P", str(Path(__file__).with_name(file)))


def ask_native(command: Sequence[str], question: Arrays, *, timeout: float, way_out: str) -> dict[str, np.ndarray]:
    """What the worker answers: npz on its stdin, npz on its stdout.

    timeout: seconds. way_out: what somebody can do when it takes too long or crashes, "lower mesh.resolution".

    Raises:
      MeshCleaningFailed: it failed, crashed, ran out of time, cannot start or is not installed whole.
    """
    sent = io.BytesIO()
    np.savez(sent, allow_pickle=False, **question)
    try:
        done = subprocess.run(list(command), input=sent.getvalue(), capture_output=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        count = len(question["faces"])
        raise MeshCleaningFailed(
            f"expected the mesh library to be done within {timeout:g} s, got no answer for {count} faces: {way_out}"
        ) from None
    except OSError as error:
        raise MeshCleaningFailed(f"expected the mesh library to start, got {error.strerror}: check the Python installation") from None
    if done.returncode == INCOMPLETE:
        raise MeshCleaningFailed(_last_line(done.stderr))
    if done.returncode != 0:
        ended = _how_it_ended(done.returncode)
        raise MeshCleaningFailed(f"expected a mesh, got {ended} from the mesh library ({_last_line(done.stderr)}): {way_out}")
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as answer:
            return dict(answer)
    except (ValueError, KeyError, OSError, EOFError):
        raise MeshCleaningFailed(f"expected a mesh from the mesh library, got bytes that are none: {way_out}") from None


def _how_it_ended(code: int) -> str:
    return f"a crash by {signal.Signals(-code).name}" if -code in set(signal.Signals) else f"exit status {code}"


def _last_line(text: bytes) -> str:
    lines = text.decode("utf-8", "replace").strip().splitlines()
    return lines[-1].strip()[:200] if lines else "it left no message"

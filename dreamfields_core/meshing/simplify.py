"""Cleaning, and fewer faces: by pymeshlab in a process of its own (see `pymeshlab_worker`)."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dreamfields_core.meshing.errors import BadBudget, BadMesh, MeshCleaningFailed
from dreamfields_core.meshing.pieces import drop_loose, flip, turn_outward, volume
from dreamfields_core.types import Mesh

WORKER = (sys.executable, "-P", str(Path(__file__).with_name("pymeshlab_worker.py")))
"""-P: the folder of the worker must not come first among the places that modules are looked for in."""


def simplify(mesh: Mesh, faces: int, *, loose_share: float = 0.01, timeout: float = 300.0, worker: Sequence[str] = WORKER) -> Mesh:
    """A clean mesh of at most `faces` faces, where its topology allows as few; colours are dropped.

    Pieces below `loose_share` of the largest one's area go, and cavities, duplicates, null faces, non-manifold edges and vertices; holes
    are closed. A closed manifold stays one: a torus cannot be had with 4 faces, so look at the count. The same input gives the same output.

    mesh: [V, 3], [F, 3]. faces: budget, at least 4. timeout: seconds. worker: the command that does the native part.

    Raises:
      BadBudget, BadMesh: before any work.
      MeshCleaningFailed: the native library failed, crashed, ran out of time or is not installed whole.
    """
    check_budget(faces)
    check_mesh(mesh)
    # Cavities are told by their winding, so a mesh that comes inside out is turned first.
    kept = drop_loose(mesh if volume(mesh) >= 0 else flip(mesh), loose_share)
    vertices, corners = _ask_worker(kept, faces, timeout, worker)
    return turn_outward(Mesh(vertices=vertices.astype(np.float32), faces=corners.astype(np.int32)))


def check_budget(faces: int) -> None:
    """Raises BadBudget below 4."""
    if isinstance(faces, bool) or not isinstance(faces, (int, np.integer)) or faces < 4:
        raise BadBudget(f"expected a budget of at least 4 faces, a tetrahedron's, got {faces!r}: set mesh.faces to 4 or more")


def check_mesh(mesh: Mesh) -> None:
    """Raises BadMesh for arrays that are no triangle mesh: the native library would crash on them, or pass NaN on in silence."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        shapes = f"{list(vertices.shape)} and {list(faces.shape)}"
        raise BadMesh(f"expected vertices [V, 3] and at least one face [F, 3], got {shapes}: extract it again")
    if not np.isfinite(vertices).all():
        raise BadMesh(f"expected finite vertices, got {int((~np.isfinite(vertices)).any(axis=1).sum())} that are not: extract it again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise BadMesh(f"expected faces that point at vertices 0..{len(vertices) - 1}, got {faces.min()}..{faces.max()}: extract it again")


def _ask_worker(mesh: Mesh, budget: int, timeout: float, worker: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    question = io.BytesIO()
    np.savez(
        question,
        vertices=np.asarray(mesh.vertices, np.float64),
        faces=np.asarray(mesh.faces, np.int32),
        budget=np.int64(min(budget, 2**31 - 1)),
    )
    try:
        done = subprocess.run(list(worker), input=question.getvalue(), capture_output=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        raise MeshCleaningFailed(
            f"expected the mesh library to be done within {timeout:g} s, got no answer for {len(mesh.faces)} faces: lower mesh.resolution"
        ) from None
    except OSError as error:
        raise MeshCleaningFailed(f"expected the mesh library to start, got {error.strerror}: check the Python installation") from None
    if done.returncode == 3:
        raise MeshCleaningFailed(_last_line(done.stderr))
    if done.returncode != 0:
        raise MeshCleaningFailed(
            f"expected a cleaned mesh, got {_how_it_ended(done.returncode)} from the mesh library ({_last_line(done.stderr)}): "
            "try another mesh.resolution or mesh.level"
        )
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as answer:
            vertices, faces = answer["vertices"], answer["faces"]
    except (ValueError, KeyError, OSError, EOFError):
        raise MeshCleaningFailed("expected a mesh from the mesh library, got bytes that are none: try again") from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise MeshCleaningFailed("expected a mesh with faces after cleaning, got none: raise mesh.faces or lower mesh.level")
    return vertices, faces


def _how_it_ended(code: int) -> str:
    return f"a crash by {signal.Signals(-code).name}" if -code in set(signal.Signals) else f"exit status {code}"


def _last_line(text: bytes) -> str:
    lines = text.decode("utf-8", "replace").strip().splitlines()
    return lines[-1].strip()[:200] if lines else "it left no message"

"""Cleaning, smoothing, and fewer faces: by pymeshlab in a process of its own (see `pymeshlab_worker`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dreamfields_core.meshing.errors import BadBudget, BadMesh, MeshCleaningFailed
from dreamfields_core.meshing.native import ask_native, worker
from dreamfields_core.meshing.pieces import drop_loose, flip, turn_outward, volume
from dreamfields_core.types import Mesh

WORKER = worker("pymeshlab_worker.py")
SMALLEST = 4
"""Faces of a tetrahedron."""


@dataclass(frozen=True)
class Simplified:
    """mesh: clean, without colours. crossing: how many of its faces cut another one."""

    mesh: Mesh
    crossing: int


def simplify(mesh: Mesh, faces: int, *, loose_share: float = 0.01, timeout: float = 1800.0, command: Sequence[str] = WORKER) -> Mesh:
    """A clean mesh of at most `faces` faces; see `simplify_levels`."""
    return simplify_levels(mesh, (faces,), loose_share=loose_share, timeout=timeout, command=command)[0].mesh


def simplify_levels(
    mesh: Mesh,
    budgets: Sequence[int],
    *,
    error: float | None = None,
    smooth: int = 0,
    loose_share: float = 0.01,
    timeout: float = 1800.0,
    command: Sequence[str] = WORKER,
) -> list[Simplified]:
    """Clean meshes of at most so many faces each, where the topology allows as few; colours are dropped.

    Pieces below `loose_share` of the largest one's area go, and cavities, duplicates, null faces, non-manifold edges and vertices; holes
    are closed. A closed manifold stays one: a torus cannot be had with 4 faces, so look at the count. The same input gives the same output.

    mesh: [V, 3], [F, 3]. budgets: falling, each at least 4. error: world units; given, the first mesh has the fewest faces that keep the
    vertices of `mesh` within it, and never more than its budget. smooth: rounds of Taubin's smoothing before.
    timeout: seconds. command: what does the native part.

    Raises:
      BadBudget, BadMesh: before any work.
      MeshCleaningFailed: the native library failed, crashed, ran out of time or is not installed whole.
    """
    check_budgets(budgets, error=error, smooth=smooth)
    check_mesh(mesh)
    # Cavities are told by their winding, so a mesh that comes inside out is turned first.
    kept = drop_loose(mesh if volume(mesh) >= 0 else flip(mesh), loose_share)
    question: dict[str, np.ndarray] = {
        "vertices": np.asarray(kept.vertices, np.float64),
        "faces": np.asarray(kept.faces, np.int32),
        "budgets": np.minimum(np.asarray(budgets, np.int64), 2**31 - 1),
        "error": np.asarray(np.inf if error is None else error),
        "smooth": np.asarray(smooth),
    }
    answer = ask_native(command, question, timeout=timeout, way_out="lower mesh.resolution or try another mesh.level")
    return [_read(answer, k) for k in range(len(budgets))]


def check_budgets(budgets: Sequence[int], *, error: float | None = None, smooth: int = 0) -> None:
    """Raises BadBudget for a budget below 4, budgets that do not fall, and bounds that are none."""
    for faces in budgets:
        if isinstance(faces, bool) or not isinstance(faces, (int, np.integer)) or faces < SMALLEST:
            raise BadBudget(f"expected a budget of at least 4 faces, a tetrahedron's, got {faces!r}: set mesh.faces to 4 or more")
    if not budgets or any(later >= earlier for earlier, later in pairwise(budgets)):
        raise BadBudget(f"expected budgets that fall, got {list(budgets)}: give every level of detail fewer faces than the one before")
    if error is not None and not (np.isfinite(error) and error > 0):
        raise BadBudget(f"expected an error bound above 0 in world units, got {error!r}: set mesh.error to 0.005, or to null for none")
    if smooth < 0:
        raise BadBudget(f"expected 0 or more rounds of smoothing, got {smooth!r}: set mesh.smooth to 0 for none")


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


def _read(answer: dict[str, np.ndarray], level: int) -> Simplified:
    try:
        vertices, faces, crossing = (answer[f"{name}{level}"] for name in ("vertices", "faces", "crossing"))
    except KeyError:
        raise MeshCleaningFailed("expected as many meshes as budgets from the mesh library, got fewer: try again") from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise MeshCleaningFailed("expected a mesh with faces after cleaning, got none: raise mesh.faces or lower mesh.level")
    return Simplified(turn_outward(Mesh(vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))), int(crossing))

"""The native mesh library in a process of its own: npz on stdin, npz on stdout, one sentence on stderr when it fails.

Run by `simplify`. A crash in native code, or its state that clings to the whole process, then costs one call and no more.
It imports nothing of this project, so that it starts in a fraction of a second.

in:  vertices [V, 3] float64, faces [F, 3] int32, budgets [L] int64 (falling), error () float64 (infinite for none), smooth () int64.
out: vertices<k> [V', 3] float64, faces<k> [F', 3] int32, crossing<k> () int64 for each budget k: faces that cut another one.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any

import numpy as np

COLLAPSE = "meshing_decimation_quadric_edge_collapse"
PROBES = 50_000
"""Vertices at most whose distance is measured for the error bound."""


def collapse(meshes: Any, budget: int, *, keep_normals: bool) -> None:
    """Quadric edge collapse (Garland and Heckbert, SIGGRAPH 1997) to the budget or as near as the topology lets it.

    All parameters every time: the library remembers those left out from the call before.
    """
    getattr(meshes, COLLAPSE)(
        targetfacenum=budget,
        targetperc=0.0,
        qualitythr=0.3,
        preserveboundary=True,
        boundaryweight=1.0,
        preservenormal=keep_normals,
        preservetopology=True,
        optimalplacement=True,
        planarquadric=True,
        planarweight=0.001,
        qualityweight=False,
        autoclean=True,
        selected=False,
    )


def reduce(meshes: Any, budget: int) -> None:
    """At most `budget` faces where the topology allows. Keeping normals can stall above a small budget; the second try gives them up."""
    for keep_normals in (True, False):
        if meshes.current_mesh().face_number() > budget:
            collapse(meshes, budget, keep_normals=keep_normals)


def reduce_within(meshes: Any, error: float) -> Any:
    """The mesh with the fewest faces, to a sixteenth, that keeps every vertex of the given one within `error` of it; a new set."""
    probes = meshes.current_mesh().vertex_matrix()
    probes = probes[:: -(-len(probes) // PROBES)]
    good, low, high = meshes, 0, meshes.current_mesh().face_number()
    while high - low > max(high // 16, 3):
        # Halving first: each try starts from the last good mesh, so that all tries together cost little more than the first.
        budget = high // 2 if low == 0 else (low + high) // 2
        tried = alone(good)
        reduce(tried, budget)
        if distance(probes, tried) <= error and tried.current_mesh().face_number() < high:
            good, high = tried, tried.current_mesh().face_number()
        else:
            low = budget
    return good


def alone(meshes: Any) -> Any:
    """A new set that holds a copy of the current mesh only."""
    mesh = meshes.current_mesh()
    return mesh_set(mesh.vertex_matrix(), mesh.face_matrix())


def distance(points: np.ndarray, meshes: Any) -> float:
    """The largest distance of points [N, 3] from the current mesh."""
    pair = alone(meshes)
    pair.add_mesh(_library().Mesh(vertex_matrix=points))
    found = pair.get_hausdorff_distance(
        sampledmesh=1,
        targetmesh=0,
        savesample=False,
        samplevert=True,
        sampleedge=False,
        samplefauxedge=False,
        sampleface=False,
        samplenum=len(points),
        maxdist=_percent(100.0),
    )
    return float(found["max"])


def smoothen(meshes: Any, iterations: int) -> None:
    """Taubin, "A signal processing approach to fair surface design", SIGGRAPH 1995: a step in, a step out, so that nothing shrinks."""
    if iterations:
        meshes.apply_coord_taubin_smoothing(lambda_=0.5, mu=-0.53, stepsmoothnum=iterations, selected=False)


def crossing_faces(meshes: Any) -> int:
    """How many faces cut another one."""
    meshes.compute_selection_by_self_intersections_per_face()
    count = int(meshes.current_mesh().selected_face_number())
    meshes.set_selection_none()
    return count


def heal(meshes: Any) -> None:
    """Duplicates, null faces, non-manifold edges and vertices, holes: in the order in which each relies on the one before."""
    meshes.meshing_remove_null_faces()  # a repeated index crashes the collapse
    meshes.meshing_remove_duplicate_faces()
    meshes.meshing_remove_unreferenced_vertices()
    # Taking faces away can bare further non-manifold edges, and holes refuse to close while there are any.
    for _ in range(4):
        meshes.meshing_repair_non_manifold_edges(method="Remove Faces")
        meshes.meshing_repair_non_manifold_vertices(vertdispratio=0.0)
        counts = meshes.get_topological_measures()
        if counts["non_two_manifold_edges"]:
            continue
        if not counts["boundary_edges"]:
            break
        meshes.meshing_close_holes(
            maxholesize=1000,
            selected=False,
            newfaceselected=False,
            selfintersection=False,
            refinehole=False,
            refineholeedgelen=_percent(3.0),
        )
    meshes.meshing_remove_unreferenced_vertices()
    if not _turns_one_way(meshes.current_mesh().face_matrix()):
        meshes.meshing_re_orient_faces_coherently()


def _turns_one_way(faces: np.ndarray) -> bool:
    """No two faces run along an edge in the same direction."""
    starts, ends = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    edges = np.sort(starts * (faces.max(initial=0) + 1) + ends)
    return bool((edges[1:] != edges[:-1]).all())


def mesh_set(vertices: np.ndarray, faces: np.ndarray) -> Any:
    """A set with one mesh."""
    meshes = _library().MeshSet()
    meshes.add_mesh(_library().Mesh(vertex_matrix=vertices, face_matrix=faces))
    return meshes


def _library() -> Any:
    import pymeshlab

    return pymeshlab


def _percent(value: float) -> Any:
    return _library().PercentageValue(value)


def work(
    vertices: np.ndarray, faces: np.ndarray, budgets: np.ndarray, error: float, smooth: int
) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Heal, smoothen, and for each budget collapse what the one before left, and heal what that broke."""
    if COLLAPSE not in _library().filter_list():
        raise ImportError("quadric collapse is missing")
    meshes = mesh_set(vertices, faces)
    heal(meshes)
    smoothen(meshes, smooth)
    if np.isfinite(error):
        meshes = reduce_within(meshes, error)
    made = []
    for budget in budgets:
        reduce(meshes, int(budget))
        heal(meshes)
        mesh = meshes.current_mesh()
        made.append((mesh.vertex_matrix(), mesh.face_matrix(), crossing_faces(meshes)))
    return made


def main() -> int:
    """Exit status: 0, 3 for a library that is not whole, anything else for what nobody foresaw."""
    # The library prints; what it prints must not mix with the answer.
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        vertices, faces, budgets, error, smooth = (given[name] for name in ("vertices", "faces", "budgets", "error", "smooth"))
    try:
        levels = work(vertices, faces, budgets, float(error), int(smooth))
    except ImportError as fault:
        reason = str(fault).splitlines()[0]
        print(f"pymeshlab is not installed whole ({reason}): install the Debian packages libgl1 and libopengl0", file=sys.stderr)
        return 3
    arrays: dict[str, np.ndarray] = {}
    for k, (vertices, faces, crossing) in enumerate(levels):
        arrays[f"vertices{k}"] = np.asarray(vertices, np.float64)
        arrays[f"faces{k}"] = np.asarray(faces, np.int32)
        arrays[f"crossing{k}"] = np.asarray(crossing)
    blob = io.BytesIO()
    np.savez(blob, allow_pickle=False, **arrays)
    with answer:
        answer.write(blob.getvalue())
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # the answer is out: no destructor of a native plug-in may spoil it

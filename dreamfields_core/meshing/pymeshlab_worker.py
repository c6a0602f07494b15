"""The native mesh library in a process of its own: npz on stdin, npz on stdout, one sentence on stderr when it fails.

Run by `simplify`. A crash in native code, or its state that clings to the whole process, then costs one call and no more.
It imports nothing of this project, so that it starts in a fraction of a second.

in:  vertices [V, 3] float64, faces [F, 3] int32, budget () int64.   out: vertices [V', 3] float64, faces [F', 3] int32.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any

import numpy as np

COLLAPSE = "meshing_decimation_quadric_edge_collapse"


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
    edges = starts * (faces.max(initial=0) + 1) + ends
    return len(np.unique(edges)) == len(edges)


def _percent(value: float) -> Any:
    import pymeshlab

    return pymeshlab.PercentageValue(value)


def work(vertices: np.ndarray, faces: np.ndarray, budget: int) -> tuple[np.ndarray, np.ndarray]:
    """Heal, collapse to at most `budget` faces where the topology allows, heal again what the collapse broke."""
    import pymeshlab

    if COLLAPSE not in pymeshlab.filter_list():
        raise ImportError("quadric collapse is missing")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices, face_matrix=faces))
    heal(meshes)
    # Keeping normals can stall above a small budget; the second try gives them up.
    for keep_normals in (True, False):
        if meshes.current_mesh().face_number() > budget:
            collapse(meshes, budget, keep_normals=keep_normals)
    heal(meshes)
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix()


def main() -> int:
    """Exit status: 0, 3 for a library that is not whole, anything else for what nobody foresaw."""
    # The library prints; what it prints must not mix with the answer.
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        vertices, faces, budget = given["vertices"], given["faces"], int(given["budget"])
    try:
        vertices, faces = work(vertices, faces, budget)
    except ImportError as error:
        reason = str(error).splitlines()[0]
        print(f"pymeshlab is not installed whole ({reason}): install the Debian packages libgl1 and libopengl0", file=sys.stderr)
        return 3
    blob = io.BytesIO()
    np.savez(blob, vertices=np.asarray(vertices, np.float64), faces=np.asarray(faces, np.int32))
    with answer:
        answer.write(blob.getvalue())
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # the answer is out: no destructor of a native plug-in may spoil it

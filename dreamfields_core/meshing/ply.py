"""PLY: Z up as in the scene, display colours in bytes a vertex, as mesh viewers expect; the format says nothing of either."""

from __future__ import annotations

import numpy as np

from dreamfields_core.meshing.simplify import check_mesh
from dreamfields_core.meshing.tangents import unit_normals
from dreamfields_core.meshing.texels import vertex_colors
from dreamfields_core.types import Mesh

KINDS = {"<f4": "float", "u1": "uchar"}


def to_ply(mesh: Mesh) -> bytes:
    """Binary little-endian, with normals and colours; of a textured mesh those of the texture. Seams are closed again.

    Raises: BadMesh.
    """
    check_mesh(mesh)
    columns = {name: ("<f4", axis) for name, axis in zip("xyz", np.asarray(mesh.vertices).T)}
    columns |= {name: ("<f4", axis) for name, axis in zip(("nx", "ny", "nz"), unit_normals(mesh).T)}
    colors = vertex_colors(mesh)
    if colors is not None:
        levels = np.rint(255 * np.clip(colors, 0, 1))
        columns |= {name: ("u1", level) for name, level in zip(("red", "green", "blue"), levels.T)}
    kept, place = _one_a_position(np.asarray(mesh.vertices))
    points = np.empty(len(kept), [(name, kind) for name, (kind, _) in columns.items()])
    for name, (_, values) in columns.items():
        points[name] = values[kept]
    triangles = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, place[mesh.faces]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property {KINDS[kind]} {name}" for name, (kind, _) in columns.items()),
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode("ascii") + points.tobytes() + triangles.tobytes()


def _one_a_position(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which vertices to keep, in their order, and the new number of each: without uv nothing tells a seam's two sides apart."""
    _, first, place = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return first[order], np.argsort(order)[place.ravel()]

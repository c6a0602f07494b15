"""Binary STL for printing: Z up, triangles and nothing else. It has no unit: slicers take one scene unit for a millimetre."""

from __future__ import annotations

import numpy as np

from dreamfields_core.meshing.simplify import check_mesh
from dreamfields_core.types import Mesh

HEADER = b"dreamfields, one unit is one metre, Z up".ljust(80)
"""Must not begin with "solid", by which readers know the other kind."""


def to_stl(mesh: Mesh) -> bytes:
    """Triangles with their own unit normals. Raises: BadMesh."""
    check_mesh(mesh)
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["normal"] = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    triangles["corners"] = corners
    return HEADER + len(triangles).to_bytes(4, "little") + triangles.tobytes()

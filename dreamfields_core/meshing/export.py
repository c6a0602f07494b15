"""A mesh as files: every format by its name. Axes, units and colour spaces are said where each is written (docs/assets.md)."""

from __future__ import annotations

from collections.abc import Callable

from dreamfields_core.meshing import glb, obj, ply, stl, usdz
from dreamfields_core.meshing.provenance import Provenance, beside
from dreamfields_core.types import Mesh

Files = dict[str, bytes]
"""Name, to stand in one folder -> bytes."""

BESIDE = "mesh.json"
"""The provenance, where the format has no room for it."""

FORMATS: dict[str, Callable[[Mesh, Provenance], Files]] = {
    "glb": lambda mesh, provenance: {"mesh.glb": glb.to_glb(mesh, provenance)},
    "obj": lambda mesh, provenance: {**obj.to_obj(mesh), BESIDE: beside(provenance)},
    "ply": lambda mesh, provenance: {"mesh.ply": ply.to_ply(mesh), BESIDE: beside(provenance)},
    "stl": lambda mesh, provenance: {"mesh.stl": stl.to_stl(mesh), BESIDE: beside(provenance)},
    "usdz": lambda mesh, provenance: {"mesh.usdz": usdz.to_usdz(mesh, provenance)},
}
"""Name of a format -> (mesh, provenance) -> files, the one called mesh.<format> among them. All raise BadMesh."""

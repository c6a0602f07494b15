"""A mesh as files: every format by its name. Axes, units and colour spaces are said where each is written (docs/assets.md)."""

from __future__ import annotations

from typing import Protocol

from dreamfields_core.meshing import glb, obj, ply, stl, usdz
from dreamfields_core.meshing.provenance import Provenance, beside
from dreamfields_core.types import Mesh

Files = dict[str, bytes]
"""Name, to stand in one folder -> bytes."""


class Writer(Protocol):
    """(mesh, provenance) -> files, the one called <name>.<format> among them. Raises: BadMesh."""

    def __call__(self, mesh: Mesh, provenance: Provenance, *, name: str = "mesh") -> Files: ...


def _glb(mesh: Mesh, provenance: Provenance, *, name: str = "mesh") -> Files:
    return {f"{name}.glb": glb.to_glb(mesh, provenance)}


def _obj(mesh: Mesh, provenance: Provenance, *, name: str = "mesh") -> Files:
    return {**obj.to_obj(mesh, name=name), **_beside(provenance, name)}


def _ply(mesh: Mesh, provenance: Provenance, *, name: str = "mesh") -> Files:
    return {f"{name}.ply": ply.to_ply(mesh), **_beside(provenance, name)}


def _stl(mesh: Mesh, provenance: Provenance, *, name: str = "mesh") -> Files:
    return {f"{name}.stl": stl.to_stl(mesh), **_beside(provenance, name)}


def _usdz(mesh: Mesh, provenance: Provenance, *, name: str = "mesh") -> Files:
    return {f"{name}.usdz": usdz.to_usdz(mesh, provenance)}


def _beside(provenance: Provenance, name: str) -> Files:
    """The provenance, where the format has no room for it."""
    return {f"{name}.json": beside(provenance)}


FORMATS: dict[str, Writer] = {"glb": _glb, "obj": _obj, "ply": _ply, "stl": _stl, "usdz": _usdz}
"""By their names."""

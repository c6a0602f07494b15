"""The files of a stored mesh in the formats that somebody asks for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from flows.order import OrderError
from storage.artifacts import ArtifactRef, get_artifact
from storage.contract import Store

FORMATS = ("glb", "obj", "ply", "stl", "usdz")
"""As `dreamfields_core.meshing.FORMATS` has them, whose import takes seconds."""
MESHES = re.compile(r"mesh(_lod\d+)?\.glb")
"""The mesh, and its lighter levels of detail."""


def check_formats(names: Iterable[str]) -> None:
    """Raises OrderError for a format that is not there."""
    for name in names:
        if name not in FORMATS:
            raise OrderError(f'expected a format among {", ".join(FORMATS)}, got "{name}": name one of these')


def copied(outputs: Iterable[ArtifactRef], formats: Sequence[str]) -> list[ArtifactRef]:
    """The outputs that are files of these formats already: GLB, as the store has it."""
    return [ref for ref in outputs if "glb" in formats and MESHES.fullmatch(ref.name)]


def lighter(outputs: Iterable[ArtifactRef]) -> list[ArtifactRef]:
    """The levels of detail beside mesh.glb."""
    return [ref for ref in outputs if MESHES.fullmatch(ref.name) and ref.name != "mesh.glb"]


def converted(meshes: Mapping[str, bytes], formats: Sequence[str]) -> dict[str, bytes]:
    """The other formats, made of mesh.glb and its lighter ones, which hold all that they hold; name -> bytes. Raises: BadMesh."""
    others = [name for name in formats if name != "glb"]
    if not others:
        return {}
    from dreamfields_core.meshing import FORMATS as WRITERS
    from dreamfields_core.meshing import from_glb, provenance_of

    files: dict[str, bytes] = {}
    for file, data in meshes.items():
        geometry, provenance = from_glb(data), provenance_of(data)
        for format in others:
            files |= WRITERS[format](geometry, provenance, name=file.removesuffix(".glb"))
    return files


def files_of(outputs: Sequence[ArtifactRef], store: Store, formats: Sequence[str]) -> dict[str, bytes]:
    """Every file of a mesh step's outputs in these formats. Raises: MissingArtifact, DamagedArtifact, BadMesh."""
    meshes = {ref.name: get_artifact(store, ref) for ref in outputs if MESHES.fullmatch(ref.name)}
    return (meshes if "glb" in formats else {}) | converted(meshes, formats)

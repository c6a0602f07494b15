"""From a field to a mesh that an engine can take: the level, the surface, cleaning, simplification, colours, bytes.

World space is right-handed with Z up, faces wind counter-clockwise seen from outside, colours are display values in [0, 1].
"""

from dreamfields_core.meshing.asset import Asset, Look, extract_mesh
from dreamfields_core.meshing.color import colors_from, vertex_normals
from dreamfields_core.meshing.errors import (
    BadBudget,
    BadMesh,
    BadResolution,
    FieldEmpty,
    FieldFull,
    FieldNotFinite,
    MeshCleaningFailed,
    MeshError,
    SilhouetteEmpty,
)
from dreamfields_core.meshing.export import FORMATS
from dreamfields_core.meshing.fidelity import Fidelity, Seen, fidelity
from dreamfields_core.meshing.glb import to_glb
from dreamfields_core.meshing.glb_reader import from_glb, provenance_of
from dreamfields_core.meshing.isosurface import isosurface
from dreamfields_core.meshing.level import Level, Views, choose_level
from dreamfields_core.meshing.pieces import weld
from dreamfields_core.meshing.raycast import MeshRendering, cast, render_mesh
from dreamfields_core.meshing.report import MeshReport, report
from dreamfields_core.meshing.simplify import simplify, simplify_levels

__all__ = [
    "FORMATS",
    "Asset",
    "BadBudget",
    "BadMesh",
    "BadResolution",
    "Fidelity",
    "FieldEmpty",
    "FieldFull",
    "FieldNotFinite",
    "Level",
    "Look",
    "MeshCleaningFailed",
    "MeshError",
    "MeshRendering",
    "MeshReport",
    "Seen",
    "SilhouetteEmpty",
    "Views",
    "cast",
    "choose_level",
    "colors_from",
    "extract_mesh",
    "fidelity",
    "from_glb",
    "isosurface",
    "provenance_of",
    "render_mesh",
    "report",
    "simplify",
    "simplify_levels",
    "to_glb",
    "vertex_normals",
    "weld",
]

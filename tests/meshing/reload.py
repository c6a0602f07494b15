"""Files of every format, read by libraries that are not ours, and brought back to the conventions of the project."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image


@dataclass(frozen=True)
class Reloaded:
    """vertices [V, 3], Z up; faces [F, 3]; normals [V, 3] or None; uv [V, 2], v up, or None; image uint8 [S, S, 3] or None;
    paint: what the file says of colours of vertices, [V, 3] in [0, 1], in the file's own colour space, or None."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    image: np.ndarray | None = None
    paint: np.ndarray | None = None


def write(files: dict[str, bytes], folder: Path) -> Path:
    """Put the files into the folder; the one that an importer is pointed at."""
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return next(folder / name for name in files if name.startswith("mesh.") and not name.endswith((".json", ".png", ".mtl")))


def reload(path: Path) -> Reloaded:
    """Read it as another program would."""
    return _from_usd(path) if path.suffix == ".usdz" else _from_trimesh(path)


def upright(points: np.ndarray) -> np.ndarray:
    """Y up -> Z up, written as a rotation by 90 degrees about X."""
    return np.asarray(points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))


def _from_trimesh(path: Path) -> Reloaded:
    scene: Any = trimesh.load_scene(path, process=False)
    ((transform, name),) = [scene.graph[node] for node in scene.graph.nodes_geometry]
    np.testing.assert_array_equal(transform, np.eye(4))
    loaded = scene.geometry[name]
    turn = upright if path.suffix in (".glb", ".obj") else np.asarray
    uv = getattr(loaded.visual, "uv", None)
    material = getattr(loaded.visual, "material", None)
    image = None if material is None else getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    paint = getattr(loaded.visual, "vertex_attributes", {}).get("color")  # of a glTF, as they stand there
    if loaded.visual.kind == "vertex":
        paint = loaded.visual.vertex_colors[:, :3] / 255
    return Reloaded(
        vertices=turn(np.asarray(loaded.vertices)),
        faces=np.asarray(loaded.faces),
        normals=turn(np.asarray(loaded.vertex_normals)),
        uv=None if uv is None else np.asarray(uv),
        image=None if image is None else np.asarray(image.convert("RGB")),
        paint=paint,
    )


def _from_usd(path: Path) -> Reloaded:
    from pxr import Usd, UsdGeom, UsdShade

    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1
    prim = next(prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    mesh, primvars = UsdGeom.Mesh(prim), UsdGeom.PrimvarsAPI(prim)
    uv, paint = (primvars.GetPrimvar(name).Get() if primvars.HasPrimvar(name) else None for name in ("st", "displayColor"))
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    surface, _, _ = material.ComputeSurfaceSource("")
    source = surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source.GetPrim()
    image = None
    if (file := UsdShade.Shader(source).GetInput("file")) and file.Get():
        with zipfile.ZipFile(path) as package, package.open(file.Get().path) as picture:
            image = np.asarray(Image.open(picture).convert("RGB"))
    return Reloaded(
        vertices=upright(np.array(mesh.GetPointsAttr().Get())),
        faces=np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3),
        normals=upright(np.array(mesh.GetNormalsAttr().Get())),
        uv=None if uv is None else np.array(uv),
        image=image,
        paint=None if paint is None else np.array(paint),
    )

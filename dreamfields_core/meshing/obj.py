"""OBJ with its material library and textures: Y up and metres, as importers take it by default; all colours are display values."""

from __future__ import annotations

import io

import numpy as np

from dreamfields_core.meshing.axes import to_y_up
from dreamfields_core.meshing.simplify import check_mesh
from dreamfields_core.meshing.tangents import unit_normals
from dreamfields_core.meshing.texels import check_texture
from dreamfields_core.png import png
from dreamfields_core.types import Mesh


def to_obj(mesh: Mesh, *, name: str = "mesh") -> dict[str, bytes]:
    """name.obj, and of a textured mesh name.mtl, name.png and, where there is a normal map, name_normal.png. Raises: BadMesh."""
    check_mesh(mesh)
    check_texture(mesh)
    if mesh.texture is None:
        return {f"{name}.obj": _geometry(mesh, "")}
    material = ["newmtl surface", "Ka 0 0 0", "Kd 1 1 1", "Ks 0 0 0", "illum 1", f"map_Kd {name}.png"]
    files = {f"{name}.obj": _geometry(mesh, f"mtllib {name}.mtl\nusemtl surface\n"), f"{name}.png": png(mesh.texture.color)}
    if mesh.texture.normal_map is not None:
        material.append(f"norm {name}_normal.png")
        files[f"{name}_normal.png"] = png(mesh.texture.normal_map)
    return {**files, f"{name}.mtl": ("\n".join(material) + "\n").encode()}


def _geometry(mesh: Mesh, use_material: str) -> bytes:
    file = io.StringIO()
    file.write(f"# dreamfields: metres, Y up\no object\n{use_material}")
    points = to_y_up(np.asarray(mesh.vertices))
    if mesh.texture is None and mesh.colors is not None:
        points = np.concatenate([points, np.clip(mesh.colors, 0, 1)], axis=1)  # a custom that readers share
    _rows(file, "v", points, "%.9g")
    _rows(file, "vn", to_y_up(unit_normals(mesh)), "%.6g")
    numbers = np.asarray(mesh.faces) + 1
    if mesh.texture is not None:
        assert mesh.uv is not None
        _rows(file, "vt", mesh.uv, "%.9g")
        np.savetxt(file, np.repeat(numbers, 3, axis=1), "f %d/%d/%d %d/%d/%d %d/%d/%d")
    else:
        np.savetxt(file, np.repeat(numbers, 2, axis=1), "f %d//%d %d//%d %d//%d")
    return file.getvalue().encode("ascii")


def _rows(file: io.StringIO, word: str, values: np.ndarray, form: str) -> None:
    np.savetxt(file, values, " ".join([word, *[form] * values.shape[1]]))

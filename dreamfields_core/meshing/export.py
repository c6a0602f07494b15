"""A mesh as the bytes of a file, and back.

glTF has Y up and linear vertex colours; the project has Z up and display colours (a pixel value of 0.5 is middle grey on a
screen). So (x, y, z) is written as (x, z, -y), and colours through the sRGB curve. PLY says nothing of either: it is left Z up,
with display colours in bytes, as mesh viewers expect.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import trimesh
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from dreamfields_core.meshing.color import linear_to_srgb, srgb_to_linear, vertex_normals
from dreamfields_core.meshing.errors import BadMesh
from dreamfields_core.types import Mesh

Provenance = Mapping[str, Any]
"""JSON-able: caption, seed, digests; goes where the format has room for it."""

_VERTEX_BUFFER, _INDEX_BUFFER = 34962, 34963


def to_y_up(points: np.ndarray) -> np.ndarray:
    """[..., 3] Z up -> Y up, a rotation."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def to_z_up(points: np.ndarray) -> np.ndarray:
    """The inverse of `to_y_up`."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def to_glb(mesh: Mesh, provenance: Provenance) -> bytes:
    """Binary glTF 2.0: positions, unit normals, float colours, a matt material, provenance in asset.extras.

    The same input gives the same bytes.

    Raises:
      BadMesh: the provenance is not JSON-able, NaN included.
    """
    try:
        extras = json.loads(json.dumps(dict(provenance), sort_keys=True, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise BadMesh(f"expected provenance of plain JSON values, got one that is not ({error}): convert it first") from None
    attributes: dict[str, Any] = {}
    if mesh.colors is not None:
        attributes["_color"] = srgb_to_linear(np.asarray(mesh.colors, np.float64)).astype(np.float32)
    matt = PBRMaterial(name="surface", baseColorFactor=[255, 255, 255, 255], metallicFactor=0.0, roughnessFactor=1.0)
    geometry = trimesh.Trimesh(
        vertices=to_y_up(np.asarray(mesh.vertices, np.float64)),
        faces=mesh.faces,
        vertex_normals=to_y_up(vertex_normals(mesh)),
        vertex_attributes=attributes,
        visual=TextureVisuals(material=matt),
        process=False,
    )
    scene = trimesh.Scene(base_frame="world")
    scene.add_geometry(geometry, node_name="object", geom_name="object")
    data: bytes = trimesh.exchange.gltf.export_glb(
        scene, include_normals=True, unitize_normals=True, tree_postprocessor=lambda tree: _finish(tree, extras)
    )
    return data


def _finish(tree: dict[str, Any], extras: dict[str, Any]) -> None:
    """What the library leaves out: the standard name of the colours, what each buffer view is for, where the object comes from."""
    for mesh in tree["meshes"]:
        mesh.pop("extras", None)
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            for name in [name for name in attributes if name.lower().lstrip("_") == "color"]:
                attributes["COLOR_0"] = attributes.pop(name)
            for accessor in attributes.values():
                tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = _VERTEX_BUFFER
            tree["bufferViews"][tree["accessors"][primitive["indices"]]["bufferView"]]["target"] = _INDEX_BUFFER
    tree["asset"]["extras"] = extras


def to_ply(mesh: Mesh) -> bytes:
    """Binary little-endian PLY with byte colours."""
    colors = None if mesh.colors is None else np.round(255 * np.clip(mesh.colors, 0, 1)).astype(np.uint8)
    geometry = trimesh.Trimesh(vertices=mesh.vertices, faces=mesh.faces, vertex_colors=colors, process=False)
    data: bytes = trimesh.exchange.ply.export_ply(geometry, encoding="binary", vertex_normal=False)
    return data


def from_glb(data: bytes) -> Mesh:
    """The mesh that `to_glb` wrote, Z up and in display colours again.

    Raises:
      BadMesh: no binary glTF 2.0, or not of that making.
    """
    try:
        tree, blob = _chunks(data)
        primitive = tree["meshes"][0]["primitives"][0]
        attributes = primitive["attributes"]
        colors = _array(tree, blob, attributes["COLOR_0"]) if "COLOR_0" in attributes else None
        return Mesh(
            vertices=to_z_up(_array(tree, blob, attributes["POSITION"])),
            faces=_array(tree, blob, primitive["indices"]).reshape(-1, 3).astype(np.int32),
            colors=None if colors is None else linear_to_srgb(colors.astype(np.float64)).astype(np.float32),
        )
    except (KeyError, IndexError, ValueError, struct.error) as error:
        raise BadMesh(f"expected a binary glTF as this project writes it, got {len(data)} bytes that are none: export it again") from error


def provenance_of(data: bytes) -> dict[str, Any]:
    """asset.extras of a binary glTF."""
    return dict(_chunks(data)[0]["asset"].get("extras", {}))


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    magic, version, _, length, kind = struct.unpack_from("<4sIII4s", data)
    if (magic, version, kind) != (b"glTF", 2, b"JSON"):
        raise ValueError("not a binary glTF 2.0")
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def _array(tree: dict[str, Any], blob: bytes, number: int) -> np.ndarray:
    accessor = tree["accessors"][number]
    dtype = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
    start = tree["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(blob, dtype, accessor["count"] * width, start).reshape(-1, width)


formats: dict[str, Callable[[Mesh, Provenance], bytes]] = {
    "glb": to_glb,
    "ply": lambda mesh, provenance: to_ply(mesh),
}
"""Name of a format, which is also the file's ending -> (mesh, provenance) -> bytes."""

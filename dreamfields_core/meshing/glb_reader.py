"""Binary glTF as `to_glb` writes it, back as a mesh."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from dreamfields_core.meshing.axes import to_z_up
from dreamfields_core.meshing.color import linear_to_srgb
from dreamfields_core.meshing.errors import BadMesh
from dreamfields_core.meshing.glb import COMPONENTS, SHAPES
from dreamfields_core.png import read_png
from dreamfields_core.types import Mesh, Texture

TYPES = {number: dtype for dtype, number in COMPONENTS.items()}
WIDTHS = {name: width for width, name in SHAPES.items()}


def from_glb(data: bytes) -> Mesh:
    """The mesh that `to_glb` wrote, Z up, v up and in display colours again.

    Raises:
      BadMesh: no binary glTF 2.0, or not of that making.
    """
    try:
        tree, body = _chunks(data)
        primitive = tree["meshes"][0]["primitives"][0]
        found = {name: _array(tree, body, number) for name, number in primitive["attributes"].items()}
        faces = _array(tree, body, primitive["indices"]).reshape(-1, 3).astype(np.int32)
        uv, colors = found.get("TEXCOORD_0"), found.get("COLOR_0")
        return Mesh(
            vertices=to_z_up(found["POSITION"]),
            faces=faces,
            colors=None if colors is None else linear_to_srgb(colors.astype(np.float64)).astype(np.float32),
            normals=to_z_up(found["NORMAL"]),
            uv=None if uv is None else np.stack([uv[:, 0], 1 - uv[:, 1]], axis=-1),
            texture=_texture(tree, body),
        )
    except (KeyError, IndexError, ValueError, struct.error, OSError) as error:
        raise BadMesh(f"expected a binary glTF as this project writes it, got {len(data)} bytes that are none: export it again") from error


def provenance_of(data: bytes) -> dict[str, Any]:
    """asset.extras of a binary glTF. Raises: BadMesh."""
    try:
        return dict(_chunks(data)[0]["asset"].get("extras", {}))
    except (KeyError, ValueError, struct.error) as error:
        raise BadMesh(f"expected a binary glTF, got {len(data)} bytes that are none: export it again") from error


def _texture(tree: dict[str, Any], body: bytes) -> Texture | None:
    material = tree["materials"][0]
    color, normal = material["pbrMetallicRoughness"].get("baseColorTexture"), material.get("normalTexture")
    if color is None:
        return None
    return Texture(_image(tree, body, color["index"]), None if normal is None else _image(tree, body, normal["index"]))


def _image(tree: dict[str, Any], body: bytes, number: int) -> np.ndarray:
    view = tree["bufferViews"][tree["images"][tree["textures"][number]["source"]]["bufferView"]]
    return read_png(body[view["byteOffset"] : view["byteOffset"] + view["byteLength"]])


def _array(tree: dict[str, Any], body: bytes, number: int) -> np.ndarray:
    accessor = tree["accessors"][number]
    width = WIDTHS[accessor["type"]]
    start = tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
    return np.frombuffer(body, TYPES[accessor["componentType"]], accessor["count"] * width, start).reshape(-1, width)


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    magic, version, _, length, kind = struct.unpack_from("<4sIII4s", data)
    if (magic, version, kind) != (b"glTF", 2, b"JSON"):
        raise ValueError("not a binary glTF 2.0")
    return json.loads(data[20 : 20 + length]), data[28 + length :]

"""Binary glTF 2.0: Y up, metres, a matt material, and where the object comes from in asset.extras.

Colours of a texture are display (sRGB) values, as the standard has them; colours of vertices are linear there, so they pass
through the sRGB curve. glTF counts v downward; the project upward. The section numbers are the specification's.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from dreamfields_core.meshing.axes import to_y_up
from dreamfields_core.meshing.color import srgb_to_linear
from dreamfields_core.meshing.provenance import Provenance, plain
from dreamfields_core.meshing.simplify import check_mesh
from dreamfields_core.meshing.tangents import unit_normals, vertex_tangents
from dreamfields_core.meshing.texels import check_texture
from dreamfields_core.png import png
from dreamfields_core.types import Mesh

VERTICES, INDICES = 34962, 34963
COMPONENTS: dict[np.dtype[Any], int] = {np.dtype("<f4"): 5126, np.dtype("<u4"): 5125, np.dtype("<u2"): 5123}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
SAMPLER = {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}
"""Linear, with mipmaps, clamped at the edges."""


def to_glb(mesh: Mesh, provenance: Provenance) -> bytes:
    """The mesh with its texture (and normal map, in the frame of `vertex_tangents`), else with the colours of its vertices.

    The same input gives the same bytes.

    Raises:
      BadMesh: arrays that are no textured triangle mesh, or provenance that is not JSON-able, NaN included.
    """
    check_mesh(mesh)
    check_texture(mesh)
    extras, body = plain(provenance), _Body()
    primitive = {"attributes": _attributes(mesh, body), "indices": body.array(_indices(mesh), INDICES), "material": 0}
    tree = {
        "asset": {"version": "2.0", "generator": "dreamfields", "extras": extras},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "object", "mesh": 0}],
        "meshes": [{"name": "object", "primitives": [primitive]}],
        "materials": [_material(mesh)],
        **_textures(mesh, body),
        **body.tree(),
    }
    return _binary(tree, bytes(body.data))


def _attributes(mesh: Mesh, body: _Body) -> dict[str, int]:
    """Section 3.7.2.1. Colours of vertices would be multiplied into the texture, so there are either or neither."""
    arrays = {"POSITION": to_y_up(np.asarray(mesh.vertices)), "NORMAL": to_y_up(unit_normals(mesh))}
    if mesh.texture is not None:
        assert mesh.uv is not None
        arrays["TEXCOORD_0"] = np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=-1)
        if mesh.texture.normal_map is not None:
            tangents = vertex_tangents(mesh)
            arrays["TANGENT"] = np.concatenate([to_y_up(tangents[:, :3]), tangents[:, 3:]], axis=1)
    elif mesh.colors is not None:
        arrays["COLOR_0"] = srgb_to_linear(np.clip(np.asarray(mesh.colors, np.float64), 0, 1))
    return {name: body.array(values.astype("<f4"), VERTICES, bounds=name == "POSITION") for name, values in arrays.items()}


def _indices(mesh: Mesh) -> np.ndarray:
    """[3 F, 1]; 65 535 is no vertex but the restart of a strip."""
    return np.asarray(mesh.faces).reshape(-1, 1).astype("<u2" if len(mesh.vertices) < 65_535 else "<u4")


def _material(mesh: Mesh) -> dict[str, Any]:
    """Section 3.9.2: matt and no metal, since the field's colours have no gloss of their own."""
    surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    material: dict[str, Any] = {"name": "surface", "pbrMetallicRoughness": surface}
    if mesh.texture is not None:
        surface["baseColorTexture"] = {"index": 0}
        if mesh.texture.normal_map is not None:
            material["normalTexture"] = {"index": 1}
    return material


def _textures(mesh: Mesh, body: _Body) -> dict[str, Any]:
    if mesh.texture is None:
        return {}
    pictures = {"color": mesh.texture.color, "normal": mesh.texture.normal_map}
    kept = [(name, pixels) for name, pixels in pictures.items() if pixels is not None]
    images = [{"name": name, "mimeType": "image/png", "bufferView": body.view(png(pixels))} for name, pixels in kept]
    return {"images": images, "samplers": [SAMPLER], "textures": [{"sampler": 0, "source": number} for number in range(len(images))]}


class _Body:
    """The one buffer, and what lies where in it (section 3.6)."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, **more: Any) -> int:
        """Append bytes at a multiple of four; the number of their view."""
        self.data += bytes(-len(self.data) % 4)
        self._views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more})
        self.data += data
        return len(self._views) - 1

    def array(self, values: np.ndarray, target: int, *, bounds: bool = False) -> int:
        """Append an array [N, K]; the number of its accessor."""
        accessor = {
            "bufferView": self.view(values.tobytes(), target=target),
            "componentType": COMPONENTS[values.dtype],
            "count": len(values),
            "type": SHAPES[values.shape[1]],
        }
        if bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def tree(self) -> dict[str, Any]:
        self.data += bytes(-len(self.data) % 4)
        return {"accessors": self._accessors, "bufferViews": self._views, "buffers": [{"byteLength": len(self.data)}]}


def _binary(tree: dict[str, Any], body: bytes) -> bytes:
    """Section 4.4: a header, the tree padded with spaces, the buffer."""
    text = json.dumps(tree, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(body))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body

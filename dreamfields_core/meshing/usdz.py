"""USDZ: a USD stage as text beside its textures, in an uncompressed zip whose files begin at multiples of 64 bytes.

The stage has Y up and metres, says which colours are sRGB and which raw, and holds the provenance in its customLayerData.
Colours of vertices are linear there, as in glTF.
"""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np

from dreamfields_core.meshing.axes import to_y_up
from dreamfields_core.meshing.color import srgb_to_linear
from dreamfields_core.meshing.provenance import Provenance, plain
from dreamfields_core.meshing.simplify import check_mesh
from dreamfields_core.meshing.tangents import unit_normals
from dreamfields_core.meshing.texels import check_texture
from dreamfields_core.png import png
from dreamfields_core.types import Mesh

ALIGNMENT = 64
COLOR, NORMAL = "textures/color.png", "textures/normal.png"


def to_usdz(mesh: Mesh, provenance: Provenance) -> bytes:
    """The same input gives the same bytes. Raises: BadMesh."""
    check_mesh(mesh)
    check_texture(mesh)
    files = {"mesh.usda": stage(mesh, provenance).encode()}
    if mesh.texture is not None:
        files[COLOR] = png(mesh.texture.color)
        if mesh.texture.normal_map is not None:
            files[NORMAL] = png(mesh.texture.normal_map)
    return _package(files)


def stage(mesh: Mesh, provenance: Provenance) -> str:
    """The stage as USD text. Raises: BadMesh."""
    told = json.dumps(json.dumps(plain(provenance), sort_keys=True))  # a JSON text as a quoted one: USD's escapes are JSON's own
    points, normals = to_y_up(np.asarray(mesh.vertices)), to_y_up(unit_normals(mesh))
    extent = np.stack([points.min(axis=0), points.max(axis=0)])
    return f"""#usda 1.0
(
    customLayerData = {{
        string provenance = {told}
    }}
    defaultPrim = "Object"
    doc = "Made by dreamfields"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "Object" (
    kind = "component"
)
{{
    def Mesh "Surface" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        uniform bool doubleSided = 0
        float3[] extent = {_tuples(extent)}
        int[] faceVertexCounts = [{", ".join(["3"] * len(mesh.faces))}]
        int[] faceVertexIndices = [{", ".join(map(str, np.asarray(mesh.faces).ravel().tolist()))}]
        rel material:binding = </Object/Matt>
        normal3f[] normals = {_tuples(normals)} (
            interpolation = "vertex"
        )
        point3f[] points = {_tuples(points)}{_paint(mesh)}
        uniform token subdivisionScheme = "none"
    }}

    def Material "Matt"
    {{
        token outputs:surface.connect = </Object/Matt/Preview.outputs:surface>

        def Shader "Preview"
        {{
            uniform token info:id = "UsdPreviewSurface"{_inputs(mesh)}
            float inputs:metallic = 0
            float inputs:roughness = 1
            token outputs:surface
        }}{_shaders(mesh)}
    }}
}}
"""


def _paint(mesh: Mesh) -> str:
    """What the material reads of the mesh: places on the texture, or colours."""
    if mesh.texture is not None:
        assert mesh.uv is not None
        return _primvar("texCoord2f[]", "st", mesh.uv)
    if mesh.colors is not None:
        return _primvar("color3f[]", "displayColor", srgb_to_linear(np.clip(np.asarray(mesh.colors, np.float64), 0, 1)))
    return ""


def _primvar(kind: str, name: str, values: np.ndarray) -> str:
    return f"""
        {kind} primvars:{name} = {_tuples(values)} (
            interpolation = "vertex"
        )"""


def _inputs(mesh: Mesh) -> str:
    if mesh.texture is None:
        source = "" if mesh.colors is None else ".connect = </Object/Matt/Color.outputs:result>"
        return f"\n            color3f inputs:diffuseColor{source or ' = (0.5, 0.5, 0.5)'}"
    text = "\n            color3f inputs:diffuseColor.connect = </Object/Matt/Color.outputs:rgb>"
    if mesh.texture.normal_map is not None:
        text += "\n            normal3f inputs:normal.connect = </Object/Matt/Normal.outputs:rgb>"
    return text


def _shaders(mesh: Mesh) -> str:
    if mesh.texture is None:
        return "" if mesh.colors is None else _reader("Color", "float3", "displayColor")
    text = _reader("Place", "float2", "st") + _picture("Color", COLOR, "sRGB")
    if mesh.texture.normal_map is not None:
        # 0.5 (n + 1) is undone: n = 2 texel - 1.
        text += _picture("Normal", NORMAL, "raw", "(2, 2, 2, 1)", "(-1, -1, -1, 0)")
    return text


def _reader(name: str, kind: str, primvar: str) -> str:
    return f"""

        def Shader "{name}"
        {{
            uniform token info:id = "UsdPrimvarReader_{kind}"
            string inputs:varname = "{primvar}"
            {kind} outputs:result
        }}"""


def _picture(name: str, path: str, space: str, scale: str = "(1, 1, 1, 1)", bias: str = "(0, 0, 0, 0)") -> str:
    return f"""

        def Shader "{name}"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{path}@
            token inputs:sourceColorSpace = "{space}"
            float4 inputs:scale = {scale}
            float4 inputs:bias = {bias}
            float2 inputs:st.connect = </Object/Matt/Place.outputs:result>
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float3 outputs:rgb
        }}"""


def _tuples(values: np.ndarray) -> str:
    """[N, K] as USD writes it; nine digits give a float32 back exactly."""
    row = "(" + ", ".join(["%.9g"] * values.shape[1]) + ")"
    return "[" + ", ".join([row % tuple(line) for line in values.tolist()]) + "]"


def _package(files: dict[str, bytes]) -> bytes:
    """Stored, not compressed, so that readers map them (USDZ specification, "Layout")."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as package:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)  # dated 1980, so that the same files give the same bytes
            start = file.tell() + 30 + len(name)
            gap = (-start) % ALIGNMENT
            gap += ALIGNMENT if 0 < gap < 4 else 0  # a padding has a header of four bytes
            entry.extra = b"\x86\x19" + (gap - 4).to_bytes(2, "little") + bytes(gap - 4) if gap else b""
            package.writestr(entry, data)
    return file.getvalue()

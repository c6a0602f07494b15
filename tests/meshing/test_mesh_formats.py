"""Every format, read back by other libraries: the same bounds, the same way up, the same colours at the same places."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dreamfields_core.meshing import FORMATS, BadMesh
from dreamfields_core.meshing.color import linear_to_srgb
from dreamfields_core.meshing.pieces import volume
from dreamfields_core.types import Mesh, Texture
from tests.meshing.reload import Reloaded, reload, write
from tests.meshing.textured import CENTRE, SIZE, color_at, globe, on_sphere, painted_globe, waves

PROVENANCE = {"seed": 3, "caption": 'a "red" box\n\\ of é', "digests": ["ab", "cd"]}
TEXTURED, LINEAR = ("glb", "obj", "usdz"), ("glb", "usdz")


def place_of(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where points of the globe lie on its texture, and which of them are far from the seam and the poles."""
    x, y, z = ((vertices - CENTRE) / SIZE).T
    u, v = np.arctan2(y, x) / (2 * np.pi) % 1, np.arcsin(np.clip(z, -1, 1)) / np.pi + 0.5
    return u, v, (np.abs(u - 0.5) < 0.45) & (np.abs(v - 0.5) < 0.45) & (np.abs(u - 0.5) > 0.05)


def colors_of(loaded: Reloaded, name: str) -> np.ndarray:
    """Display colours [V, 3] as the file has them at its vertices."""
    if loaded.image is None:
        assert loaded.paint is not None
        return linear_to_srgb(loaded.paint) if name in LINEAR else loaded.paint
    assert loaded.uv is not None
    side = len(loaded.image)
    column, row = loaded.uv[:, 0] * side, (1 - loaded.uv[:, 1]) * side
    return np.asarray(loaded.image[np.clip(row, 0, side - 1).astype(int), np.clip(column, 0, side - 1).astype(int)] / 255)


@pytest.mark.parametrize("textured", [True, False], ids=["textured", "vertex colours"])
@pytest.mark.parametrize("name", FORMATS)
def test_it_comes_back_the_same_way_up_and_in_the_same_colours(name: str, textured: bool, tmp_path: Path) -> None:
    mesh = globe() if textured else painted_globe()
    loaded = reload(write(FORMATS[name](mesh, PROVENANCE), tmp_path))
    np.testing.assert_allclose(loaded.vertices.min(axis=0), mesh.vertices.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(loaded.vertices.max(axis=0), mesh.vertices.max(axis=0), atol=1e-6)
    assert volume(Mesh(loaded.vertices, loaded.faces)) == pytest.approx(volume(mesh), rel=1e-5)
    if name == "stl":
        return
    u, v, sure = place_of(loaded.vertices)
    assert sure.sum() > 100
    np.testing.assert_allclose(colors_of(loaded, name)[sure], color_at(u, v)[sure], atol=0.06 if textured else 0.01)
    assert loaded.normals is not None
    outward = on_sphere(u, v)[sure] / SIZE
    assert ((loaded.normals[sure] * outward).sum(axis=1) / np.linalg.norm(outward, axis=1)).min() > 0.98
    assert (loaded.image is not None) == (textured and name in TEXTURED)


@pytest.mark.parametrize("mesh", [globe(6), painted_globe(6), replace(painted_globe(6), colors=None)], ids=["textured", "painted", "bare"])
@pytest.mark.parametrize("name", FORMATS)
def test_the_same_mesh_gives_the_same_bytes_in_any_order_of_provenance(name: str, mesh: Mesh) -> None:
    assert FORMATS[name](mesh, PROVENANCE) == FORMATS[name](mesh, dict(reversed(PROVENANCE.items())))
    assert f"mesh.{name}" in FORMATS[name](mesh, PROVENANCE)


@pytest.mark.parametrize("name", ["obj", "ply", "stl"])
def test_provenance_stands_beside_what_has_no_room_for_it(name: str) -> None:
    assert json.loads(FORMATS[name](globe(4), PROVENANCE)["mesh.json"]) == PROVENANCE


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("change", [{"vertices": np.full((91, 3), np.nan, np.float32)}, {"faces": np.empty((0, 3), np.int32)}], ids=list)
def test_what_is_no_mesh_is_refused(name: str, change: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(BadMesh, match="extract it again"):
        FORMATS[name](replace(globe(6), **change), {})


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "stl"])
@pytest.mark.parametrize("change", [{"uv": None}, {"uv": np.zeros((3, 2))}, {"texture": Texture(np.zeros((4, 4, 3)))}], ids=list)
def test_a_texture_that_does_not_fit_is_refused(name: str, change: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(BadMesh, match=r"unwrap the mesh again|bake it again"):
        FORMATS[name](replace(globe(6), **change), {})


def test_ply_closes_the_seams_that_a_texture_opens(tmp_path: Path) -> None:
    import trimesh

    loaded = trimesh.load(write(FORMATS["ply"](globe(), {}), tmp_path), process=False)
    assert loaded.is_watertight and len(loaded.vertices) < len(globe().vertices)


def test_usdz_is_stored_at_multiples_of_64_bytes_and_says_where_it_comes_from(tmp_path: Path) -> None:
    from pxr import Usd

    path = write(FORMATS["usdz"](globe(), PROVENANCE), tmp_path)
    data = path.read_bytes()
    with zipfile.ZipFile(io.BytesIO(data)) as package:
        assert package.testzip() is None
        for entry in package.infolist():
            assert entry.compress_type == zipfile.ZIP_STORED
            start = entry.header_offset + 30 + len(entry.filename) + int.from_bytes(data[entry.header_offset + 28 :][:2], "little")
            assert start % 64 == 0
            assert data[start : start + entry.file_size] == package.read(entry)
    stage = Usd.Stage.Open(str(path))
    assert json.loads(stage.GetRootLayer().customLayerData["provenance"]) == PROVENANCE


@pytest.mark.parametrize("mesh", [globe(6), painted_globe(6), replace(painted_globe(6), colors=None)], ids=["textured", "painted", "bare"])
def test_usd_validates(mesh: Mesh, tmp_path: Path) -> None:
    from pxr import Usd, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(write(FORMATS["usdz"](mesh, {}), tmp_path))))
    assert len(validators) > 10
    assert [f"{error.GetName()}: {error.GetMessage()}" for error in found] == []


def test_usd_reads_the_normal_map_as_raw_numbers_and_the_colour_as_srgb(tmp_path: Path) -> None:
    from pxr import Usd, UsdShade

    stage = Usd.Stage.Open(str(write(FORMATS["usdz"](globe(6), {}), tmp_path)))
    color, normal = (UsdShade.Shader(stage.GetPrimAtPath(f"/Object/Matt/{name}")) for name in ("Color", "Normal"))
    assert (color.GetInput("sourceColorSpace").Get(), normal.GetInput("sourceColorSpace").Get()) == ("sRGB", "raw")
    decoded = waves(16) / 255 * np.array(normal.GetInput("scale").Get())[:3] + np.array(normal.GetInput("bias").Get())[:3]
    np.testing.assert_allclose(np.linalg.norm(decoded, axis=-1), 1, atol=0.02)


def test_obj_names_its_textures_and_colours_them_fully() -> None:
    files = FORMATS["obj"](globe(4), {})
    assert set(files) == {"mesh.obj", "mesh.mtl", "mesh.png", "mesh_normal.png", "mesh.json"}
    material = files["mesh.mtl"].decode().splitlines()
    assert {"Kd 1 1 1", "map_Kd mesh.png", "norm mesh_normal.png"} <= set(material)
    assert b"mtllib mesh.mtl" in files["mesh.obj"]

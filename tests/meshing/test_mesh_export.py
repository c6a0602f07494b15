"""Files read back by another reader: bounds, axes, colours, bytes."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from dreamfields_core.meshing import BadMesh, formats, from_glb, isosurface, provenance_of, report, to_glb, to_ply, with_colors
from dreamfields_core.meshing.color import linear_to_srgb, srgb_to_linear
from dreamfields_core.meshing.export import to_y_up, to_z_up
from dreamfields_core.types import Mesh
from tests.meshing.shapes import box

PROVENANCE = {"seed": 3, "caption": "a box", "digests": ["ab", "cd"]}


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return with_colors(isosurface(box, 0.0, resolution=32), lambda p: (p + 1) / 2, inset=0.01)


def tree_of(data: bytes) -> dict:  # type: ignore[type-arg]
    (length,) = struct.unpack_from("<I", data, 12)
    return dict(json.loads(data[20 : 20 + length]))


def test_glb_has_y_up_in_another_reader(mesh: Mesh) -> None:
    loaded: Any = trimesh.load(io.BytesIO(to_glb(mesh, PROVENANCE)), file_type="glb", force="mesh", process=False)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose(loaded.bounds, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=1e-6)
    assert loaded.is_watertight and loaded.volume == pytest.approx(report(mesh).volume, rel=1e-5)


def test_glb_comes_back_exactly(mesh: Mesh) -> None:
    back = from_glb(to_glb(mesh, PROVENANCE))
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    assert back.colors is not None and mesh.colors is not None
    np.testing.assert_allclose(back.colors, mesh.colors, atol=1e-6)


def test_glb_is_the_same_bytes_every_time_and_whatever_the_order_of_provenance(mesh: Mesh) -> None:
    assert to_glb(mesh, PROVENANCE) == to_glb(mesh, dict(reversed(PROVENANCE.items())))


def test_glb_says_what_it_is(mesh: Mesh) -> None:
    data = to_glb(mesh, PROVENANCE)
    tree = tree_of(data)
    assert provenance_of(data) == tree["asset"]["extras"] == PROVENANCE
    assert {view["target"] for view in tree["bufferViews"]} == {34962, 34963}
    (material,) = tree["materials"]
    assert material["pbrMetallicRoughness"]["metallicFactor"] == 0 and material["pbrMetallicRoughness"]["roughnessFactor"] == 1
    assert set(tree["meshes"][0]["primitives"][0]["attributes"]) == {"POSITION", "NORMAL", "COLOR_0"}
    assert len(data) % 4 == 0


def test_color_0_is_linear(mesh: Mesh) -> None:
    grey = Mesh(mesh.vertices, mesh.faces, np.full_like(mesh.vertices, 0.5))
    data = to_glb(grey, {})
    assert np.float32(0.21404114).tobytes() in data


def test_a_mesh_without_colors_has_no_color_0(mesh: Mesh) -> None:
    data = to_glb(Mesh(mesh.vertices, mesh.faces), {})
    assert "COLOR_0" not in tree_of(data)["meshes"][0]["primitives"][0]["attributes"]
    assert from_glb(data).colors is None


@pytest.mark.parametrize("bad", [{"a": object()}, {"a": float("nan")}])
def test_provenance_that_is_no_json_is_refused(mesh: Mesh, bad: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(BadMesh, match="plain JSON"):
        to_glb(mesh, bad)


@pytest.mark.parametrize("data", [b"", b"glTF", b"no glTF at all, but long enough to look at"])
def test_bytes_that_are_no_glb_are_refused(data: bytes) -> None:
    with pytest.raises(BadMesh, match="export it again"):
        from_glb(data)


def test_ply_is_z_up_with_byte_colors(mesh: Mesh) -> None:
    loaded: Any = trimesh.load(io.BytesIO(to_ply(mesh)), file_type="ply", process=False)
    np.testing.assert_allclose(loaded.bounds, [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], atol=1e-6)
    assert mesh.colors is not None
    np.testing.assert_allclose(loaded.visual.vertex_colors[:, :3] / 255, mesh.colors, atol=0.51 / 255)


@pytest.mark.parametrize("name", formats)
def test_every_format_is_deterministic(mesh: Mesh, name: str) -> None:
    assert formats[name](mesh, PROVENANCE) == formats[name](mesh, PROVENANCE)


@given(st.lists(st.floats(0, 1), min_size=1))
def test_the_color_curves_undo_each_other(values: list[float]) -> None:
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(np.array(values))), values, atol=1e-6)


def test_turning_axes_is_undone_and_is_no_mirror() -> None:
    axes = np.eye(3)
    np.testing.assert_array_equal(to_z_up(to_y_up(axes)), axes)
    assert np.linalg.det(to_y_up(axes)) == pytest.approx(1)

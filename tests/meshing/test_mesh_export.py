"""Binary glTF: its tree, its numbers, and the way back."""

from __future__ import annotations

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dreamfields_core.meshing import BadMesh, from_glb, isosurface, provenance_of, to_glb
from dreamfields_core.meshing.axes import to_y_up, to_z_up
from dreamfields_core.meshing.color import linear_to_srgb, srgb_to_linear
from dreamfields_core.types import Mesh
from tests.meshing.shapes import box, colored
from tests.meshing.textured import globe, painted_globe

PROVENANCE = {"seed": 3, "caption": "a box", "digests": ["ab", "cd"]}


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return colored(isosurface(box, 0.0, resolution=32), lambda p: (p + 1) / 2, inset=0.01)


def tree_of(data: bytes) -> dict:  # type: ignore[type-arg]
    (length,) = struct.unpack_from("<I", data, 12)
    return dict(json.loads(data[20 : 20 + length]))


def test_glb_comes_back_exactly(mesh: Mesh) -> None:
    back = from_glb(to_glb(mesh, PROVENANCE))
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    assert back.colors is not None and mesh.colors is not None
    np.testing.assert_allclose(back.colors, mesh.colors, atol=1e-6)


def test_a_textured_glb_comes_back_exactly() -> None:
    mesh = globe()
    back = from_glb(to_glb(mesh, PROVENANCE))
    for name in ("vertices", "faces", "normals"):
        np.testing.assert_array_equal(getattr(back, name), getattr(mesh, name))
    assert back.uv is not None and mesh.uv is not None and back.texture is not None and mesh.texture is not None
    np.testing.assert_allclose(back.uv, mesh.uv, atol=1e-7)
    np.testing.assert_array_equal(back.texture.color, mesh.texture.color)
    assert back.texture.normal_map is not None and mesh.texture.normal_map is not None
    np.testing.assert_array_equal(back.texture.normal_map, mesh.texture.normal_map)
    assert back.colors is None


def test_a_texture_takes_the_place_of_vertex_colors_which_would_be_multiplied_into_it() -> None:
    mesh = replace(globe(4), colors=painted_globe(4).colors)
    assert set(tree_of(to_glb(mesh, {}))["meshes"][0]["primitives"][0]["attributes"]) == {"POSITION", "NORMAL", "TANGENT", "TEXCOORD_0"}


def test_v_runs_down_in_glb() -> None:
    mesh = globe(4)
    data = to_glb(mesh, {})
    assert mesh.uv is not None
    assert np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=-1).astype("<f4").tobytes() in data


def test_more_vertices_than_two_bytes_number_come_back_too() -> None:
    mesh = replace(painted_globe(182), colors=None)
    assert len(mesh.vertices) > 65_535
    np.testing.assert_array_equal(from_glb(to_glb(mesh, {})).faces, mesh.faces)


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


@pytest.mark.parametrize("lost", [b"POSITION", b"NORMAL"])
def test_a_glb_that_lacks_what_every_mesh_has_is_refused(mesh: Mesh, lost: bytes) -> None:
    data = to_glb(mesh, {})
    assert lost in data
    with pytest.raises(BadMesh, match="export it again"):
        from_glb(data.replace(lost, b"X" * len(lost)))


@given(st.lists(st.floats(0, 1), min_size=1))
def test_the_color_curves_undo_each_other(values: list[float]) -> None:
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(np.array(values))), values, atol=1e-6)


def test_turning_axes_is_undone_and_is_no_mirror() -> None:
    axes = np.eye(3)
    np.testing.assert_array_equal(to_z_up(to_y_up(axes)), axes)
    assert np.linalg.det(to_y_up(axes)) == pytest.approx(1)

"""Charts, texels and the bake, against colours and normals that are known by formula."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.meshing import (
    BadBudget,
    Look,
    MeshCleaningFailed,
    MeshError,
    extract_mesh,
    isosurface,
    render_mesh,
    report,
    simplify,
    weld,
)
from dreamfields_core.meshing.bake import bake
from dreamfields_core.meshing.lattice import Packed
from dreamfields_core.meshing.rasterise import barycentric, covering, rasterise
from dreamfields_core.meshing.surface import Surface, gradients, just_below, onto_surface, outward, through, with_normals
from dreamfields_core.meshing.tangents import vertex_tangents
from dreamfields_core.meshing.texels import texel
from dreamfields_core.meshing.unwrap import unwrap
from dreamfields_core.types import Mesh, Texture
from tests.meshing.shapes import cameras, sphere, torus

CELL = 2 / 64


def stripes(points: np.ndarray) -> np.ndarray:
    """Colours around and across the torus, the same at every depth."""
    around = np.arctan2(points[:, 1], points[:, 0])
    across = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]) - 0.6)
    return 0.5 + 0.45 * np.stack([np.sin(6 * around + 2 * across), np.cos(3 * across), np.sin(3 * around)], axis=-1)


def surface_of(field, colors=stripes) -> Surface:  # type: ignore[no-untyped-def]
    return Surface(Packed(field), 0.0, CELL, just_below(colors, inset=0.0))


@pytest.fixture(scope="module")
def ring() -> tuple[Mesh, np.ndarray]:
    """A torus of 5 000 faces with normals and uv, and the field's slopes at its vertices."""
    mesh, slopes = with_normals(simplify(isosurface(torus, 0.0, resolution=64), 5000), surface_of(torus))
    flat, source = unwrap(mesh, 1024)
    return flat, slopes[source]


@pytest.fixture(scope="module")
def baked(ring: tuple[Mesh, np.ndarray]) -> Texture:
    return bake(*ring, surface_of(torus), 1024, normal_map=True)


def points_on(mesh: Mesh, count: int = 50_000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(faces [N], weights [N, 3], points [N, 3]) spread evenly over the surface."""
    rng = np.random.default_rng(0)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    weights = rng.dirichlet([1, 1, 1], count)
    return face, weights, np.einsum("nk,nkc->nc", weights, mesh.vertices[mesh.faces[face]])


def decibels(errors: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean(np.square(errors))))


def test_the_surface_is_the_same_after_unwrapping_and_faces_keep_their_order(ring: tuple[Mesh, np.ndarray]) -> None:
    flat = ring[0]
    assert flat.uv is not None and flat.uv.min() >= 0 and flat.uv.max() <= 1 and report(weld(flat)).watertight
    plain = simplify(isosurface(torus, 0.0, resolution=64), 5000)
    np.testing.assert_array_equal(flat.vertices[flat.faces], plain.vertices[plain.faces])


def test_no_two_faces_share_a_texel(ring: tuple[Mesh, np.ndarray]) -> None:
    corners = ring[0].uv[ring[0].faces].astype(float)  # type: ignore[index]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2
    assert (covering(corners * 1024 - 0.5, 1024) >= 0).mean() == pytest.approx(area, rel=0.01) and area > 0.35


def test_the_texture_is_right_between_its_texels_to_more_than_50_decibels(ring: tuple[Mesh, np.ndarray], baked: Texture) -> None:
    flat = ring[0]
    face, weights, points = points_on(flat)
    uv = np.einsum("nk,nkc->nc", weights, flat.uv[flat.faces[face]])  # type: ignore[index]
    assert decibels(texel(baked.color, uv) - stripes(points)) > 55
    at_vertices = np.einsum("nk,nkc->nc", weights, stripes(flat.vertices)[flat.faces[face]])
    assert decibels(at_vertices - stripes(points)) < 45  # what a texture is for


def test_smaller_mip_levels_show_no_seams(ring: tuple[Mesh, np.ndarray], baked: Texture) -> None:
    flat, picture = ring[0], baked.color.astype(float)
    face, weights, points = points_on(flat)
    uv = np.einsum("nk,nkc->nc", weights, flat.uv[flat.faces[face]])  # type: ignore[index]
    for _ in range(2):
        picture = picture.reshape(len(picture) // 2, 2, len(picture) // 2, 2, 3).mean(axis=(1, 3))
        assert np.abs(texel(picture, uv) - stripes(points)).max() < 0.05


def test_the_normal_map_gives_back_the_field_s_normals(ring: tuple[Mesh, np.ndarray]) -> None:
    """On normals that were turned away from the field's on purpose: the map must turn them back, in every chart."""
    flat, slopes = ring
    assert flat.uv is not None and flat.normals is not None
    bent = flat.normals + 0.3 * np.sin(5 * flat.vertices[:, [1, 2, 0]])
    flat = replace(flat, normals=(bent / np.linalg.norm(bent, axis=1, keepdims=True)).astype(np.float32))
    baked = bake(flat, slopes, surface_of(torus), 512, normal_map=True)
    assert baked.normal_map is not None
    face, weights, points = points_on(flat, 5000)

    def between(values: np.ndarray) -> np.ndarray:
        return np.einsum("nk,nkc->nc", weights, values[flat.faces[face]])

    told = 2 * texel(baked.normal_map, between(flat.uv)) - 1
    tangents, normals = between(vertex_tangents(flat)), between(flat.normals)
    up = tangents[:, 3:] * np.cross(normals, tangents[:, :3])
    seen = told[:, :1] * tangents[:, :3] + told[:, 1:2] * up + told[:, 2:] * normals
    truth = -gradients(Packed(torus), points, 1e-3)

    def degrees(vectors: np.ndarray) -> np.ndarray:
        cosine = (vectors * truth).sum(axis=1) / np.linalg.norm(vectors, axis=1) / np.linalg.norm(truth, axis=1)
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    assert degrees(normals).mean() > 8 and degrees(seen).mean() < 1.5


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_texels_are_those_whose_centres_lie_in_a_triangle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 12, (1, 3, 2))
    ys, xs = np.mgrid[:12, :12]
    slow = np.array([[_inside(corners[0], x, y) for x in range(12)] for y in range(12)])
    np.testing.assert_array_equal(covering(corners, 12) == 0, slow)
    weights = barycentric(np.broadcast_to(corners, (144, 3, 2)), np.stack([xs.ravel(), ys.ravel()], axis=-1))
    np.testing.assert_allclose(weights @ corners[0], np.stack([xs.ravel(), ys.ravel()], axis=-1), atol=1e-6)


def _inside(corners: np.ndarray, x: int, y: int) -> bool:
    turns = [np.linalg.det(np.stack([corners[(i + 1) % 3] - corners[i], [x, y] - corners[i]])) for i in range(3)]
    return all(turn >= 0 for turn in turns) or all(turn <= 0 for turn in turns)


def test_the_rim_prolongs_the_face_and_all_else_repeats_the_nearest() -> None:
    uv = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]], np.float32)
    texels = rasterise(uv, np.array([[0, 1, 2]]), 32)
    x, y = np.einsum("nk,kc->cn", texels.weights, np.stack([uv[:, 0] * 32 - 0.5, (1 - uv[:, 1]) * 32 - 0.5], axis=-1))
    np.testing.assert_allclose(x, texels.columns, atol=1e-9)
    np.testing.assert_allclose(y, texels.rows, atol=1e-9)
    assert (texels.weights < 0).any() and texels.nearest.shape == (2, 32, 32)


def test_points_are_moved_onto_the_level() -> None:
    rng = np.random.default_rng(0)
    normals = rng.standard_normal((500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = (0.6 + rng.uniform(-0.02, 0.02, (500, 1))) * normals
    moved = onto_surface(surface_of(sphere), points, normals, np.ones(500), 0.05)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.6, atol=1e-6)
    barely = onto_surface(surface_of(sphere), points, normals, np.ones(500), 0.001)
    assert np.abs(barely - points).max() < 0.0011


def test_where_the_field_has_no_slope_the_mesh_s_own_normal_stays() -> None:
    up = np.array([[0.0, 0.0, 1.0]] * 3)
    gradient = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.1, 0.0, -1.0]])
    found = outward(gradient, up)
    np.testing.assert_array_equal(found[:2], up[:2])
    np.testing.assert_allclose(found[2], np.array([-0.1, 0, 1]) / np.hypot(0.1, 1))


def test_colors_through_the_surface_are_what_the_renderer_adds_up() -> None:
    """A density that is even inside: the colour is a weighed mean over depth, known in closed form."""
    depths = np.array([[0.0, 0.0, 0.0]])
    colors = through(
        Packed(lambda p: -p[:, 2], batch=8),
        lambda p: np.repeat(np.clip(-p[:, 2:], 0, 1), 3, axis=1),
        lambda raw: np.where(raw > 0, 4.0, 0.0),
        above=0.0,
        below=0.5,
        samples=400,
        batch=8,
    )(depths, np.array([[0.0, 0.0, 1.0]]))
    # The integral of 4 exp(-4 x) x over 0 .. 0.5, and what is left of the light at the last depth.
    np.testing.assert_allclose(colors, (1 - np.exp(-2) * 3) / 4 + np.exp(-2) * 0.5, atol=2e-3)


def test_a_field_becomes_a_textured_object_with_lighter_ones_beside_it() -> None:
    made = extract_mesh(torus, stripes, level=0.0, resolution=64, faces=2000, details=(500,), look=Look(texture=512))
    origins, directions = cameras(2, 48)
    for mesh, faces, size in ((made.mesh, 2000, 512), *((mesh, 500, 256) for mesh in made.details)):
        assert len(mesh.faces) <= faces and mesh.texture is not None and mesh.texture.color.shape == (size, size, 3)
        seen = render_mesh(mesh, origins, directions)
        points = origins + seen.depth[..., None] * directions
        assert decibels((seen.color - stripes(points.reshape(-1, 3)).reshape(points.shape))[seen.hit]) > 30
    assert made.report.watertight and made.report.crossing == 0 and len(made.detail_reports) == 1
    lengths = np.linalg.norm(made.mesh.normals, axis=1)  # type: ignore[arg-type]
    np.testing.assert_allclose(lengths, 1, atol=1e-5)


@pytest.mark.parametrize(
    ("look", "told"),
    [
        (Look(texture=100), "256 to 4096"),
        (Look(texture=5000), "256 to 4096"),
        (Look(normal_map=True), "set mesh.texture"),
        (Look(samples=8), "density"),
    ],
)
def test_looks_that_cannot_be_are_refused_before_the_field_is_asked(look: Look, told: str) -> None:
    def never(points: np.ndarray) -> np.ndarray:
        raise AssertionError("asked")

    with pytest.raises(MeshError, match=told):
        extract_mesh(never, never, level=0.0, look=look)
    assert issubclass(BadBudget, MeshError)


@pytest.mark.parametrize(
    "program", ["import os; os.kill(os.getpid(), 6)", "import sys, numpy as np; np.savez(sys.stdout.buffer, faces=[0])"]
)
def test_a_chart_maker_that_fails_costs_one_sentence(ring: tuple[Mesh, np.ndarray], program: str) -> None:
    with pytest.raises(MeshCleaningFailed, match=r"set mesh\.texture to null"):
        unwrap(ring[0], 256, command=[sys.executable, "-c", program])

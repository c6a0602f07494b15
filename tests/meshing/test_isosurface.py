"""Extraction against shapes known by formula, and against asking everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.meshing import BadResolution, FieldEmpty, FieldFull, FieldNotFinite, isosurface, report
from dreamfields_core.meshing.isosurface import coarse_values, extract, surface_cells
from dreamfields_core.meshing.lattice import Lattice, Packed, Samples
from dreamfields_core.meshing.marching import illinois
from dreamfields_core.types import Mesh
from tests.meshing.shapes import HANDLES, SHAPES, VOLUMES, sphere, torus


def dense_cells(shape, resolution: int) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Keys of all cells inside the cube in which the sign changes, the obvious way."""
    lattice = Lattice((0.0, 0.0, 0.0), 1.0, resolution)
    axis = np.arange(resolution + 1)
    inside = np.empty((resolution + 1,) * 3, bool)
    for i in axis:
        plane = np.stack(np.meshgrid([i], axis, axis, indexing="ij"), axis=-1)
        inside[i] = (shape(lattice.place(plane).reshape(-1, 3).astype(np.float32)) > 0).reshape(plane.shape[1:3])
    count = sum(inside[x:, y:, z:][:resolution, :resolution, :resolution].astype(int) for x in (0, 1) for y in (0, 1) for z in (0, 1))
    return np.sort(lattice.key(np.argwhere((count > 0) & (count < 8))))


def sparse_cells(shape, resolution: int) -> tuple[np.ndarray, int]:  # type: ignore[no-untyped-def]
    samples = Samples(Lattice((0.0, 0.0, 0.0), 1.0, resolution), Packed(shape))
    cells = surface_cells(samples, coarse_values(samples), 0.0)
    within = ((cells >= 0) & (cells < resolution)).all(axis=1)
    return np.sort(samples.lattice.key(cells[within])), samples.ask.asked


@pytest.mark.parametrize("name", SHAPES)
def test_no_surface_cell_is_missed(name: str) -> None:
    found, _ = sparse_cells(SHAPES[name], 128)
    np.testing.assert_array_equal(found, dense_cells(SHAPES[name], 128))


ASKED = {"sphere": 0.055, "torus": 0.06, "box": 0.05, "plate": 0.045, "wire": 0.025, "gyroid": 0.16}
"""Share of the points of the dense grid that are asked at 256 a side, false position and cut edges included."""

OFF = {"sphere": 0.01, "torus": 0.01, "box": 0.01, "plate": 0.015, "wire": 0.015, "gyroid": 0.015}
"""Mean distance of points all over the triangles from the surface, in cells."""


def off_surface(mesh: Mesh, shape) -> float:  # type: ignore[no-untyped-def]
    """Mean distance from the surface of points spread evenly over the mesh: |g| / |gradient of g|."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rng = np.random.default_rng(0)
    face = rng.choice(len(area), 50_000, p=area / area.sum())
    points = np.einsum("nk,nkc->nc", rng.dirichlet([1, 1, 1], len(face)), mesh.vertices[mesh.faces[face]].astype(np.float64))
    sides = [(shape(points + 1e-5 * axis) - shape(points - 1e-5 * axis)) / 2e-5 for axis in np.eye(3)]
    return float(np.mean(np.abs(shape(points)) / np.maximum(np.linalg.norm(sides, axis=0), 0.1)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ASKED)
def test_at_256_no_cell_is_missed_few_points_are_asked_and_the_surface_is_near(name: str) -> None:
    samples = Samples(Lattice((0.0, 0.0, 0.0), 1.0, 256), Packed(SHAPES[name]))
    coarse = coarse_values(samples)
    cells = surface_cells(samples, coarse, 0.0)
    np.testing.assert_array_equal(np.sort(samples.lattice.key(cells)), dense_cells(SHAPES[name], 256))
    off = off_surface(extract(samples, coarse, 0.0), SHAPES[name]) / samples.lattice.cell
    print(f"{name}: {100 * samples.ask.asked / 257**3:.2f} % asked, {off:.4f} cells off")
    assert samples.ask.asked <= ASKED[name] * 257**3 and off <= OFF[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "torus", "plate"])
def test_at_512_less_than_three_in_a_hundred_points_are_asked(name: str) -> None:
    samples = Samples(Lattice((0.0, 0.0, 0.0), 1.0, 512), Packed(SHAPES[name]))
    extract(samples, coarse_values(samples), 0.0)
    print(f"{name}: {100 * samples.ask.asked / 513**3:.2f} % asked")
    assert samples.ask.asked <= 0.03 * 513**3


@pytest.mark.parametrize("name", SHAPES)
def test_closed_manifold_of_the_right_volume_and_topology(name: str) -> None:
    found = report(isosurface(SHAPES[name], 0.0, resolution=128))
    assert found.watertight and found.manifold and found.volume > 0
    if name in VOLUMES:
        # The plate has one layer of corners inside: marching cubes bevels its whole rim.
        assert found.volume == pytest.approx(VOLUMES[name], rel=0.02 if name == "plate" else 0.01)
    if name in HANDLES:
        assert found.euler == HANDLES[name]


@pytest.mark.parametrize("shape", [sphere, torus])
def test_vertices_and_faces_lie_on_smooth_surfaces(shape) -> None:  # type: ignore[no-untyped-def]
    mesh, cell = isosurface(shape, 0.0, resolution=128), 2 / 128
    assert np.abs(shape(mesh.vertices)).mean() <= 0.001 * cell
    assert np.abs(shape(mesh.vertices[mesh.faces].mean(axis=1))).mean() <= 0.01 * cell


def test_false_position_beats_straight_lines_on_a_bent_field() -> None:
    def bent(points: np.ndarray) -> np.ndarray:
        return np.expm1(20 * sphere(points))

    errors = [np.abs(sphere(isosurface(bent, 0.0, resolution=64, steps=steps).vertices)).mean() for steps in (0, 1, 2)]
    assert errors[1] < 0.3 * errors[0] and errors[2] < errors[1] and errors[2] < 0.002 * 2 / 64


def test_illinois_finds_the_root_where_false_position_creeps() -> None:
    root = np.array([0.3, 0.95])
    t = illinois(lambda which, t: t**9 - root[which] ** 9, -(root**9), 1 - root**9, 30)
    np.testing.assert_allclose(t, root, atol=5e-3)


def test_an_object_through_the_bounds_is_closed_at_them() -> None:
    def half(points: np.ndarray) -> np.ndarray:
        return 0.25 - points[:, 2]

    mesh = isosurface(half, 0.0, resolution=32)
    found = report(mesh)
    assert found.watertight and found.manifold and found.euler == 2
    assert found.volume == pytest.approx(4 * 1.25, rel=0.001)
    assert np.abs(mesh.vertices).max() <= 1 + 0.002 * 2 / 32


def test_origin_and_bound_move_the_cube() -> None:
    centre = (3.0, -2.0, 0.5)
    mesh = isosurface(lambda p: sphere(p, 1.2, centre), 0.0, origin=centre, bound=2.0, resolution=64)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), np.array(centre) - 1.2, atol=2e-3)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), np.array(centre) + 1.2, atol=2e-3)


def test_the_level_is_subtracted() -> None:
    mesh = isosurface(sphere, 0.2, resolution=64)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.4, atol=1e-4)


def test_the_field_sees_one_batch_size_and_progress_counts_the_points() -> None:
    sizes: set[tuple[tuple[int, ...], str]] = set()
    told: list[int] = []

    def watched(points: np.ndarray) -> np.ndarray:
        sizes.add((points.shape, points.dtype.name))
        return sphere(points)

    isosurface(watched, 0.0, resolution=128, batch=5000, progress=told.append)
    assert sizes == {((5000, 3), "float32")}
    assert told == sorted(told) and 65**3 < told[-1] < 0.25 * 129**3


def test_the_same_field_gives_the_same_mesh() -> None:
    first, second = (isosurface(torus, 0.0, resolution=64, batch=batch) for batch in (1000, 32768))
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)


def test_an_empty_field_says_what_to_do() -> None:
    with pytest.raises(FieldEmpty, match="lower the level"):
        isosurface(lambda p: sphere(p) - 5, 0.0, resolution=16)


def test_a_full_field_says_what_to_do() -> None:
    with pytest.raises(FieldFull, match="raise the level"):
        isosurface(lambda p: sphere(p) + 5, 0.0, resolution=16)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_field_that_is_not_finite_is_refused(bad: float) -> None:
    with pytest.raises(FieldNotFinite, match="earlier checkpoint"):
        isosurface(lambda p: np.where(p[:, 0] > 0.9, bad, sphere(p)), 0.0, resolution=16)


def test_a_field_of_the_wrong_shape_is_refused() -> None:
    with pytest.raises(FieldNotFinite, match="one value a point"):
        isosurface(lambda p: sphere(p)[:, None], 0.0, resolution=16)


@pytest.mark.parametrize("resolution", [0, 1, -64, 129, 1000001])
def test_lattices_that_cannot_be_refined_are_refused(resolution: int) -> None:
    with pytest.raises(BadResolution, match="multiple of 64"):
        isosurface(sphere, 0.0, resolution=resolution)


@pytest.mark.parametrize("resolution", [2, 5, 96])
def test_all_other_resolutions_work(resolution: int) -> None:
    assert report(isosurface(sphere, 0.0, resolution=resolution)).watertight


@pytest.mark.parametrize("bound", [0.0, -1.0, float("nan")])
def test_a_cube_without_size_is_refused(bound: float) -> None:
    with pytest.raises(BadResolution, match="half-side"):
        isosurface(sphere, 0.0, bound=bound)

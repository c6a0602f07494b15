"""Triangles cut where the surface bends: nearer to it, closed as before, and nothing where nothing bends."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.meshing import isosurface, report
from dreamfields_core.meshing.bends import cut_bends, onto, split
from dreamfields_core.meshing.isosurface import coarse_values, surface_cells
from dreamfields_core.meshing.lattice import Lattice, Packed, Samples
from dreamfields_core.meshing.marching import march
from dreamfields_core.meshing.pieces import areas, volume
from dreamfields_core.types import Mesh
from tests.meshing.shapes import SHAPES, Shape, sphere, through_the_wall, wire


def marched(field: Shape, resolution: int) -> tuple[Mesh, Samples]:
    """Before any cut."""
    samples = Samples(Lattice((0.0, 0.0, 0.0), 1.0, resolution), Packed(field))
    return march(samples, surface_cells(samples, coarse_values(samples), 0.0), 0.0), samples


def away(mesh: Mesh, field: Shape, cell: float) -> float:
    """Mean distance of points all over the triangles from the surface, in cells."""
    rng, area = np.random.default_rng(0), areas(mesh)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[rng.choice(len(area), 50_000, p=area / area.sum())]].astype(float), 1, 0)
    u, v = np.sort(rng.random((2, 50_000, 1)), axis=0)
    return float(np.abs(field(u * a + (v - u) * b + (1 - v) * c)).mean() / cell)


def test_a_wire_of_a_cell_and_a_half_is_round() -> None:
    before, samples = marched(wire, 256)
    after = cut_bends(before, samples, 0.0)
    assert away(before, wire, samples.lattice.cell) > 0.045 and away(after, wire, samples.lattice.cell) < 0.015
    assert np.abs(wire(after.vertices.astype(float))).mean() < 0.002 * samples.lattice.cell
    found = report(after)
    assert found.watertight and found.manifold and (found.components, found.euler) == (1, 0)


@pytest.mark.parametrize("name", ["plate", "box", "gyroid", "two_spheres"])
def test_edges_and_corners_come_nearer_and_stay_closed(name: str) -> None:
    before, samples = marched(SHAPES[name], 64)
    after = cut_bends(before, samples, 0.0)
    found = report(after)
    assert found.watertight and found.manifold and found.euler == report(before).euler and len(after.faces) > len(before.faces)
    assert away(after, SHAPES[name], samples.lattice.cell) < away(before, SHAPES[name], samples.lattice.cell)


def test_where_nothing_bends_nothing_is_asked() -> None:
    before, samples = marched(sphere, 128)
    asked = samples.ask.asked
    assert cut_bends(before, samples, 0.0) is before and samples.ask.asked == asked


def test_what_the_bounds_cut_stays_within_them() -> None:
    assert np.abs(isosurface(through_the_wall, 0.0, resolution=32).vertices).max() <= 1 + 0.0011 * 2 / 32


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_every_pattern_of_cuts_keeps_a_mesh_closed_and_its_shape(share: float) -> None:
    mesh, _ = marched(sphere, 16)
    faces = np.asarray(mesh.faces, np.int64)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    cut = np.random.default_rng(0).random(len(edges)) < share
    added = np.full(len(edges), -1)
    added[cut] = len(mesh.vertices) + np.arange(cut.sum())
    middles = mesh.vertices[edges[cut]].mean(axis=1)
    after = Mesh(np.concatenate([mesh.vertices, middles]), split(faces, added[number.ravel()].reshape(-1, 3)).astype(np.int32))
    found = report(after)
    assert found.watertight and found.manifold and found.euler == 2
    assert volume(after) == pytest.approx(volume(mesh), rel=1e-5) and areas(after).min() > 0
    assert len(after.faces) == len(faces) + 2 * cut.sum()


def test_a_point_that_finds_no_surface_stays() -> None:
    points, outward = np.array([[0.0, 0.0, 0.0], [0.59, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]] * 2)
    moved = onto(Packed(lambda p: np.where(np.abs(p[:, 0]) < 0.3, 1.0, sphere(p))), 0.0, points, outward, np.full(2, 0.03))
    np.testing.assert_allclose(moved, [[0, 0, 0], [0.6, 0, 0]], atol=1e-6)

"""Cleaning and collapse in the worker process, and what becomes of a worker that fails."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dreamfields_core.meshing import BadBudget, BadMesh, MeshCleaningFailed, isosurface, report, simplify, simplify_levels
from dreamfields_core.meshing.pieces import drop_loose
from dreamfields_core.meshing.simplify import WORKER
from dreamfields_core.types import Mesh
from tests.meshing.shapes import gyroid, sphere, torus, two_spheres


@pytest.fixture(scope="module")
def ball() -> Mesh:
    return isosurface(sphere, 0.0, resolution=64)


@pytest.fixture(scope="module")
def ring() -> Mesh:
    return isosurface(torus, 0.0, resolution=64)


@pytest.mark.parametrize("faces", [4, 500, 5000])
def test_a_ball_keeps_to_its_budget_and_stays_closed(ball: Mesh, faces: int) -> None:
    found = report(simplify(ball, faces))
    assert found.faces <= faces and found.watertight and found.manifold and found.euler == 2 and found.volume > 0


def test_few_faces_stay_near_the_surface(ball: Mesh) -> None:
    simple = simplify(ball, 5000)
    assert report(simple).volume == pytest.approx(report(ball).volume, rel=0.005)
    centres = simple.vertices[simple.faces].mean(axis=1)
    assert np.abs(sphere(centres)).mean() < 5e-4
    assert cKDTree(simple.vertices).query(ball.vertices)[0].max() < 0.1


def test_a_budget_that_the_topology_forbids_ends_near_it_with_the_handle_kept(ring: Mesh) -> None:
    found = report(simplify(ring, 4))
    assert found.euler == 0 and found.watertight and found.manifold and found.faces < 50


def test_handles_survive() -> None:
    wall = isosurface(gyroid, 0.0, resolution=64)
    simple = report(simplify(wall, 5000))
    assert simple.watertight and simple.manifold and simple.faces <= 5000 and simple.euler == report(wall).euler


def test_more_faces_than_there_are_changes_nothing(ball: Mesh) -> None:
    same = simplify(ball, 10_000_000)
    np.testing.assert_array_equal(same.vertices, ball.vertices)
    np.testing.assert_array_equal(same.faces, ball.faces)


def test_the_same_input_gives_the_same_mesh(ring: Mesh) -> None:
    first, second = simplify(ring, 700), simplify(ring, 700)
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)


def test_loose_pieces_below_the_share_go() -> None:
    pair = isosurface(two_spheres, 0.0, resolution=64)  # areas 9 to 4
    assert report(simplify(pair, 4000, loose_share=0.4)).components == 2
    assert report(simplify(pair, 4000, loose_share=0.5)).components == 1


def test_many_equal_pieces_all_stay() -> None:
    def balls(points: np.ndarray) -> np.ndarray:
        return 0.06 - np.linalg.norm((points + 1) % 0.25 - 0.125, axis=1)

    many = isosurface(balls, 0.0, resolution=64)
    assert report(many).components == report(drop_loose(many, 0.5)).components == 512


def test_a_cavity_goes() -> None:
    shell = isosurface(lambda p: 0.1 - np.abs(0.6 - np.linalg.norm(p, axis=1)), 0.0, resolution=64)
    assert report(shell).components == 2
    assert report(drop_loose(shell, 0.01)).volume == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=0.01)


def test_a_mesh_with_every_fault_comes_out_closed_and_outward(ball: Mesh) -> None:
    inward = ball.faces[:, ::-1]
    holed = inward[5:]
    doubled = np.concatenate([holed, holed[:3]])
    null = np.array([[7, 7, 8]], np.int32)
    fin = np.array([[holed[100][0], holed[100][1], len(ball.vertices)]], np.int32)  # a third face on one edge
    vertices = np.concatenate([ball.vertices, [[0.9, 0.9, 0.9]]]).astype(np.float32)
    found = report(simplify(Mesh(vertices=vertices, faces=np.concatenate([doubled, null, fin])), 3000))
    assert found.watertight and found.manifold and found.volume == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=0.02)


@pytest.mark.parametrize("faces", [0, 3, -1, True, 5000.5])
def test_budgets_below_a_tetrahedron_are_refused(ball: Mesh, faces: int) -> None:
    with pytest.raises(BadBudget, match="at least 4 faces"):
        simplify(ball, faces)


def test_arrays_that_are_no_mesh_are_refused(ball: Mesh) -> None:
    nan = ball.vertices.copy()
    nan[3] = np.nan
    for vertices, faces, what in [
        (nan, ball.faces, "finite vertices"),
        (ball.vertices, ball.faces + 10**6, "point at vertices"),
        (ball.vertices, ball.faces[:0], "at least one face"),
        (ball.vertices[:, :2], ball.faces, "vertices"),
    ]:
        with pytest.raises(BadMesh, match=what):
            simplify(Mesh(vertices=vertices, faces=faces), 100)


@pytest.mark.parametrize(
    ("program", "told"),
    [
        ("import os; os.kill(os.getpid(), 11)", "a crash by SIGSEGV"),
        ("import sys; print('boom', file=sys.stderr); sys.exit(1)", r"exit status 1 .*\(boom\)"),
        ("import sys; print('install the Debian packages', file=sys.stderr); sys.exit(3)", "^install the Debian packages$"),
        ("import time; time.sleep(60)", "within 1 s"),
        ("print('no npz')", "bytes that are none"),
    ],
)
def test_a_worker_that_fails_costs_one_sentence(ball: Mesh, program: str, told: str) -> None:
    with pytest.raises(MeshCleaningFailed, match=told) as caught:
        simplify(ball, 100, timeout=1.0 if "sleep" in program else 30.0, command=[sys.executable, "-c", program])
    assert "\n" not in str(caught.value)


def test_a_worker_that_cannot_start_costs_one_sentence(ball: Mesh) -> None:
    with pytest.raises(MeshCleaningFailed, match="to start"):
        simplify(ball, 100, command=["/nowhere/python"])


@pytest.mark.parametrize("stub", ["raise ImportError('libGL.so.1: cannot open')", "filter_list = lambda: ['others']"])
def test_missing_system_libraries_are_named(tmp_path, monkeypatch: pytest.MonkeyPatch, ball: Mesh, stub: str) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "pymeshlab.py").write_text(stub)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(MeshCleaningFailed, match="install the Debian packages libgl1 and libopengl0"):
        simplify(ball, 100)


def test_the_worker_imports_nothing_heavy() -> None:
    program = f"import runpy, sys; runpy.run_path({WORKER[-1]!r}); print({{'jax', 'dreamfields_core', 'scipy'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_levels_of_detail_come_from_one_call_each_lighter_and_closed(ring: Mesh) -> None:
    levels = simplify_levels(ring, (4000, 1000, 200))
    counts = [report(level.mesh, crossing=level.crossing) for level in levels]
    assert [count.faces for count in counts] == [4000, 1000, 200]
    assert all(count.watertight and count.manifold and count.winding and count.crossing == 0 for count in counts)


@pytest.mark.parametrize("error", [0.02, 0.002])
def test_an_error_bound_is_kept_with_few_faces(ring: Mesh, error: float) -> None:
    simple = simplify_levels(ring, (10**7,), error=error)[0].mesh
    # The other way round from how the worker measures: from the simple surface to the exact torus.
    corners = simple.vertices[simple.faces]
    points = np.concatenate([corners.mean(axis=1), (corners[:, 0] + corners[:, 1]) / 2, simple.vertices])
    assert np.abs(torus(points)).max() < 1.5 * error
    assert report(simple).watertight and len(simple.faces) < 0.5 * len(ring.faces)


def test_a_looser_bound_needs_fewer_faces_and_the_budget_holds_all_the_same(ring: Mesh) -> None:
    loose, tight = (len(simplify_levels(ring, (10**7,), error=error)[0].mesh.faces) for error in (0.02, 0.002))
    assert loose < tight / 3
    assert len(simplify_levels(ring, (500,), error=1e-6)[0].mesh.faces) <= 500


def test_smoothing_takes_noise_away_and_keeps_the_size(ball: Mesh) -> None:
    rng = np.random.default_rng(0)
    rough = Mesh(ball.vertices + rng.normal(0, 0.003, ball.vertices.shape).astype(np.float32), ball.faces)
    smooth = simplify_levels(rough, (10**7,), smooth=20)[0].mesh
    radii = np.linalg.norm(smooth.vertices, axis=1)
    assert radii.std() < 0.4 * np.linalg.norm(rough.vertices, axis=1).std() and radii.mean() == pytest.approx(0.6, rel=0.01)


def test_faces_that_cut_others_are_counted(ball: Mesh) -> None:
    moved = Mesh(ball.vertices + np.float32([0.3, 0.0, 0.0]), ball.faces)
    both = Mesh(np.concatenate([ball.vertices, moved.vertices]), np.concatenate([ball.faces, moved.faces + len(ball.vertices)]))
    assert simplify_levels(both, (10**7,))[0].crossing > 100


@pytest.mark.parametrize("bad", [{"budgets": (100, 100)}, {"budgets": ()}, {"error": 0.0}, {"error": float("nan")}, {"smooth": -1}])
def test_settings_that_cannot_be_are_refused(ball: Mesh, bad: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(BadBudget, match=r"expected .* got .*: "):
        simplify_levels(ball, **{"budgets": (100,), **bad})

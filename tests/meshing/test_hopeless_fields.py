"""Fields and budgets at the edge of sense: each gives a closed mesh, or one sentence with the way out."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.meshing import (
    BadBudget,
    FieldEmpty,
    FieldFull,
    FieldNotFinite,
    MeshError,
    SilhouetteEmpty,
    Views,
    extract_mesh,
    isosurface,
)
from tests.meshing.shapes import cameras, sphere, through_the_wall


def gray(points: np.ndarray) -> np.ndarray:
    return np.full_like(points, 0.5)


def made(field, **options):  # type: ignore[no-untyped-def]
    return extract_mesh(field, gray, **{"level": 0.0, "resolution": 64, "faces": 500, **options})


@pytest.mark.parametrize(
    ("field", "error"),
    [
        (lambda p: sphere(p) - 5, FieldEmpty),
        (lambda p: np.full(len(p), -3.0), FieldEmpty),
        (lambda p: sphere(p) + 5, FieldFull),
        (lambda p: np.full(len(p), np.nan), FieldNotFinite),
        (lambda p: np.where(np.abs(p).max(axis=1) < 0.01, np.nan, sphere(p)), FieldNotFinite),
    ],
)
def test_no_surface_is_one_sentence_with_the_way_out(field, error: type[MeshError]) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(error, match=r"^expected .*got .*: ") as caught:
        made(field)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("field", "error"), [(lambda p: sphere(p) - 5, FieldEmpty), (lambda p: sphere(p) + 5, FieldFull)])
def test_how_far_the_level_is_off_is_told_the_same_by_the_surface_and_by_the_asset(field, error: type[MeshError]) -> None:  # type: ignore[no-untyped-def]
    level = 1.0
    axis = np.linspace(-1, 1, 65)
    values = field(np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3))
    off = level - values.max() if error is FieldEmpty else values.min() - level
    for extract in (made, lambda field, level: isosurface(field, level, resolution=64)):
        with pytest.raises(error, match=f"got {off:.4g} {'below' if error is FieldEmpty else 'above'} it at the least"):
            extract(field, level=level)


def test_views_that_see_nothing_say_so() -> None:
    origins, directions = cameras(2, 16)
    with pytest.raises(SilhouetteEmpty, match=r"set mesh\.level"):
        made(sphere, level=None, views=Views(origins, directions, np.zeros(origins.shape[:-1])))


def test_an_object_that_leaves_the_cube_is_closed_at_its_wall() -> None:
    found = made(through_the_wall)
    assert found.report.watertight and found.report.manifold and found.report.crossing == 0
    assert np.abs(found.mesh.vertices).max() < 1.01


def test_an_object_of_specks_alone_keeps_the_largest() -> None:
    def specks(points: np.ndarray) -> np.ndarray:
        grains = [sphere(points, 0.007 + 0.001 * i, (0.5 - 0.25 * i, 0.3, -0.2)) for i in range(4)]
        return np.max(grains, axis=0)

    found = made(specks, loose_share=0.9, resolution=256)
    assert found.report.watertight and found.report.components == 1
    np.testing.assert_allclose(found.mesh.vertices.mean(axis=0), [-0.25, 0.3, -0.2], atol=0.01)


@pytest.mark.parametrize("faces", [0, 3])
def test_budgets_below_a_tetrahedron_are_refused(faces: int) -> None:
    with pytest.raises(BadBudget, match=r"set mesh\.faces"):
        made(sphere, faces=faces)


@pytest.mark.parametrize("faces", [4, 10_000_000])
def test_the_smallest_and_a_boundless_budget_are_kept(faces: int) -> None:
    found = made(sphere, faces=faces)
    assert found.report.watertight and found.report.faces <= min(faces, found.extracted.faces)

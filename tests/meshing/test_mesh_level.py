"""The level against one that is known, and the counting against trying every level."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.meshing import SilhouetteEmpty, Views, cast, choose_level, isosurface
from dreamfields_core.meshing.isosurface import coarse_values
from dreamfields_core.meshing.lattice import Lattice, Packed, Samples
from dreamfields_core.meshing.level import agreement, chord, highest
from dreamfields_core.meshing.levels import levels_of
from tests.meshing.shapes import cameras, sphere, torus

LATTICE = Lattice((0.0, 0.0, 0.0), 1.0, 64)


def blob(points: np.ndarray) -> np.ndarray:
    """Log-density of a soft ball."""
    return 3 - 8 * np.square(points).sum(axis=1)


def coarse(field) -> np.ndarray:  # type: ignore[no-untyped-def]
    return coarse_values(Samples(LATTICE, Packed(field)))


@pytest.mark.parametrize("level", [-1.5, 0.0, 2.0])
def test_a_known_level_is_found_again(level: float) -> None:
    origins, directions = cameras(4, 64)
    opacity = cast(isosurface(blob, level, resolution=64), origins, directions).hit.astype(float)
    found, _ = levels_of(Views(origins, directions, opacity), coarse(blob), LATTICE)
    # A pixel is 0.04 wide, the blob's radius is sqrt((3 - level) / 8): that blurs the level by about 0.1.
    assert found.value == pytest.approx(level, abs=0.15)
    assert found.agreement > 0.97


def test_peaks_tell_the_silhouette_of_the_mesh() -> None:
    origins, directions = cameras(3, 96)
    told = highest(coarse(torus), LATTICE, origins, directions)[0] > 0
    seen = cast(isosurface(torus, 0.0, resolution=64), origins, directions).hit.ravel()
    assert (told & seen).sum() / (told | seen).sum() > 0.98


def test_the_soft_render_of_a_gaussian_is_matched() -> None:
    """Opacity of density exp(blob) is known in closed form, its half-opacity disc too."""
    origins, directions = cameras(4, 64)
    along = -(origins * directions).sum(axis=-1)
    nearest = np.square(origins + along[..., None] * directions).sum(axis=-1)
    depth = np.exp(3 - 8 * nearest) * np.sqrt(np.pi / 8)
    found, _ = levels_of(Views(origins, directions, -np.expm1(-depth)), coarse(blob), LATTICE)
    assert found.value == pytest.approx(np.log(np.log(2) / np.sqrt(np.pi / 8)), abs=0.15)


def test_counting_agrees_with_trying() -> None:
    rng = np.random.default_rng(0)
    values, mask = rng.standard_normal(200), rng.random(200) > 0.5
    levels = np.linspace(-2.5, 2.5, 31)
    tried = [((values > level) & mask).sum() / ((values > level) | mask).sum() for level in levels]
    np.testing.assert_allclose(agreement(values, mask, levels), tried)


def test_the_best_level_is_the_middle_of_those_as_good() -> None:
    found = choose_level(np.array([[0.0, 1.0, 5.0, 6.0]]), np.array([[False, False, True, True]]))
    assert (found.value, found.agreement) == (3.0, 1.0)


def test_views_that_see_nothing_are_left_out() -> None:
    values, opaque = np.array([[0.0, 1.0, 5.0]] * 2), np.array([[False, False, True], [False] * 3])
    assert choose_level(values, opaque).agreement == 1.0


def test_nothing_opaque_is_an_error_with_the_way_out() -> None:
    with pytest.raises(SilhouetteEmpty, match="dream longer"):
        choose_level(np.zeros((2, 3)), np.zeros((2, 3), bool))


def test_rays_along_axes_through_corners_and_past_the_cube() -> None:
    origins = np.array([[-4.0, 0, 0], [-4, 1, 1], [-4, -4, -4], [-4, 2, 0], [0, 0, 0], [4, 0, 0]])
    directions = np.array([[1.0, 0, 0], [1, 0, 0], [1, 1, 1], [1, 0, 0], [0, 0, 1], [1, 0, 0]])
    near, far = chord(origins, directions, 1.0)
    np.testing.assert_allclose(near[[0, 2, 4]], [3, 3, 0])
    np.testing.assert_allclose(far[[0, 2, 4]], [5, 5, 1])
    assert np.isfinite([near[1], far[1]]).all() and (far <= near)[[3, 5]].all()
    told, places = highest(coarse(sphere), LATTICE, origins, directions)
    np.testing.assert_allclose(told[[0, 4]], 0.6, atol=0.02)
    assert np.isneginf(told[[3, 5]]).all()
    np.testing.assert_allclose(places[[0, 4]], 0, atol=0.02)

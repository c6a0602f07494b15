"""Pictures: from the right side, of the right colour, whole, and the same every time."""

from __future__ import annotations

import numpy as np
import pytest

from dreamfields_core.teaching import album, words
from dreamfields_core.teaching.language import Description, Thing, parse
from dreamfields_core.teaching.pictures import Camera, Light, random_camera, render_description


@pytest.mark.parametrize("kind", words.KINDS)
def test_every_kind_is_seen_whole(kind: str) -> None:
    cameras = [Camera(0.4, np.deg2rad(20)), Camera(2.0, np.deg2rad(45))]
    for picture in render_description(Description(Thing(kind, "red")), cameras):
        alpha = picture[..., 3]
        assert 0.02 < (alpha > 127).mean() < 0.6
        assert max(alpha[0].max(), alpha[-1].max(), alpha[:, 0].max(), alpha[:, -1].max()) == 0


def test_a_sphere_has_the_size_that_perspective_gives_it() -> None:
    (picture,) = render_description(Description(Thing("sphere", "blue")), [Camera(0.0, 0.3, focal=1.2)], size=96)
    radius = np.sqrt((picture[..., 3] / 255).sum() / np.pi) / 96
    tangents = [0.9 * scale / np.sqrt(16 - (0.9 * scale) ** 2) * 1.2 for scale in (0.8, 1.0)]
    assert tangents[0] - 0.003 < radius < tangents[1] + 0.003


@pytest.mark.parametrize("size", [25, 47])
def test_a_picture_of_odd_size_is_a_larger_one_seen_smaller(size: int) -> None:
    """Of a sphere, whose outline is round: about its middle, left as right, above as below."""
    (picture,) = render_description(Description(Thing("sphere", "blue")), [Camera(0.0, 0.0, focal=1.2)], size=size, light=Light(0.0))
    (whole,) = render_description(Description(Thing("sphere", "blue")), [Camera(0.0, 0.0, focal=1.2)], size=96, light=Light(0.0))
    assert picture.shape == (size, size, 4)
    alpha = picture[..., 3].astype(float)
    np.testing.assert_allclose(alpha, alpha[:, ::-1], atol=64)
    assert abs(alpha.mean() - whole[..., 3].mean()) < 2


def test_colours_are_those_of_the_words() -> None:
    flat = Light(0.0)
    for color, value in words.COLORS.items():
        (picture,) = render_description(Description(Thing("cube", color)), [Camera(0.3, 0.5)], light=flat)
        seen = picture[picture[..., 3] == 255][:, :3].mean(0) / 255
        np.testing.assert_allclose(seen, value, atol=0.12)


def test_what_is_on_top_is_above() -> None:
    (picture,) = render_description(parse("a red cube on top of a blue cylinder"), [Camera(1.0, 0.2)], light=Light(0.0))
    rows = np.arange(48)[:, None] * np.ones((1, 48))
    red, blue = picture[..., 0] > 150, picture[..., 2] > 150
    assert rows[red].mean() + 8 < rows[blue].mean()


@pytest.mark.parametrize("pattern", words.PATTERNS)
def test_a_pattern_shows_two_colours(pattern: str) -> None:
    (picture,) = render_description(Description(Thing("cube", "red", pattern)), [Camera(0.3, 0.5)], light=Light(0.0))
    solid = picture[picture[..., 3] == 255]
    white = (solid[:, 1] > 180).mean()
    assert 0.15 < white < 0.65


def test_azimuth_turns_about_z_and_elevation_looks_down() -> None:
    """A mug's handle stands along +X: it is on the right for an eye at -Y, which is azimuth -90 degrees."""
    cameras = [Camera(-np.pi / 2, 0.1), Camera(np.pi / 2, 0.1)]
    right, left = render_description(parse("a white mug with a red handle"), cameras, light=Light(0.0))
    columns = np.arange(48)[None, :] * np.ones((48, 1))
    red = [(p[..., 0] > 150) & (p[..., 1] < 90) for p in (right, left)]
    assert columns[red[0]].mean() > 30
    assert columns[red[1]].mean() < 18


def test_a_page_follows_from_its_seed_and_number() -> None:
    first, second, other = (album.training_page(seed, 0, n=6, size=24) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.pictures, second.pictures)
    assert first.captions == second.captions != other.captions


def test_no_lesson_is_seen_from_the_held_out_band() -> None:
    rng = np.random.default_rng(0)
    elevations = np.rad2deg([random_camera(rng, gap=album.HELD_OUT_ELEVATIONS).elevation for _ in range(500)])
    assert not ((elevations > 40) & (elevations < 50)).any()
    assert elevations.min() < 5
    assert elevations.max() > 55


def test_facts_index_their_answers() -> None:
    answers = dict(zip(album.FACTS, album.facts(parse("a striped red mug")), strict=True))
    assert album.FACTS["kind"][answers["kind"]] == "mug"
    assert album.FACTS["pattern"][answers["pattern"]] == "striped"
    assert (answers["relation"], answers["other_kind"]) == (0, 0)
    assert album.facts(parse("a mug"))[1] == -1

"""True pictures: cut, drawn and judged as the dreams are."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dreamfields_core.config import EvaluateConfig
from storage.artifacts import get_artifact, put_artifact
from storage.store import open_store
from tasks.encoders import card
from tasks.oracle import given, rendered
from tasks.step import Place, key_of, perform
from tasks.truths import ORACLE
from tests.tasks.tiny import tiny


def png(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


@pytest.mark.parametrize("shape", [(6, 10), (10, 6), (8, 8)])
def test_a_picture_is_cut_to_its_middle_square(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    side = min(shape)
    top, left = (shape[0] - side) // 2, (shape[1] - side) // 2
    seen = given(png(pixels))
    assert seen.shape == (1, side, side, 3)
    np.testing.assert_array_equal(np.round(seen[0] * 255).astype(np.uint8), pixels[top : top + side, left : left + side])


def test_true_views_stand_on_white_one_an_azimuth() -> None:
    seen = rendered("a red ball", EvaluateConfig(azimuths=(0.0, 90.0)), size=24)
    assert seen.shape == (2, 24, 24, 3) and seen.min() >= 0 and seen.max() <= 1
    np.testing.assert_array_equal(seen[:, 0, 0], 1)
    assert (seen[:, 12, 12, 0] > seen[:, 12, 12, 1] + 0.3).all(), "red in the middle"


def test_only_what_the_judge_sees_and_the_pool_decide_the_key() -> None:
    key, *others = (
        key_of(ORACLE, tiny(change), {"caption": "a red ball"})
        for change in ("evaluate.picture_size=64", "evaluate.picture_size=96", "evaluate.elevation=7", "evaluate.pool=9")
    )
    assert others[0] == key and len({key, *others}) == 3


@pytest.mark.slow
def test_the_judge_recognises_the_truth_and_not_another_picture(tmp_path: Path) -> None:
    place, config, judge = Place(open_store(tmp_path)), tiny(), card("embedded-judge").digest
    true = perform(ORACLE, place, config, {"caption": "a red ball", "judge": judge}).record
    assert true.values["field"]["random"]["correct"] and set(true.values["field"]) == {"random", "hard"}
    with Image.open(io.BytesIO(get_artifact(place.store, true.output("poster.webp")))) as poster:
        assert poster.size[0] == poster.size[1]
    white = put_artifact(place.store, "white.png", png(np.full((32, 40, 3), 255, np.uint8)), "image/png")
    false = perform(ORACLE, place, config, {"caption": "a red ball", "judge": judge, "picture": white}).record
    assert not false.values["field"]["random"]["correct"]
    assert perform(ORACLE, place, config, {"caption": "a red ball", "judge": judge}).cached

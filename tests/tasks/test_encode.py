"""The text embedding: of the caption alone, in several wordings, or one for each side that a camera may see."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import ConfigError
from dreamfields_core.guidance.views import view_captions
from storage.artifacts import get_artifact
from storage.store import open_store
from tasks.encoders import card, load_encoder
from tasks.step import Event, Place, perform
from tasks.steps import ENCODE, SCORE
from tests.tasks import small_clip
from tests.tasks.tiny import tiny


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(small_clip.write(tmp_path_factory.mktemp("models") / "clip"))


class Desk:
    """Where captions are encoded, and what was said meanwhile."""

    def __init__(self, folder: Path) -> None:
        self.said: list[Event] = []
        self.place = Place(open_store(folder / "store"), self.said.append)

    def encode(self, name: str, *settings: str, caption: str = "a red cube") -> np.ndarray:
        config = tiny(f"guidance.name={name}", *settings)
        done = perform(ENCODE, self.place, config, {"caption": caption, "guide": card(name).digest})
        return np.load(io.BytesIO(get_artifact(self.place.store, done.output("text_embedding.npy"))), allow_pickle=False)


def spoken(name: str, *captions: str) -> np.ndarray:
    """The model asked directly."""
    model = load_encoder(name, towers=("text",))
    return np.asarray(jax.jit(model.encode_text)(model.params, jnp.asarray(model.tokenize(captions))))


def test_a_plain_caption_is_the_models_own_vector_to_the_bit(clip: str, tmp_path: Path) -> None:
    for name in ("embedded", clip):
        np.testing.assert_array_equal(Desk(tmp_path / Path(name).name).encode(name), spoken(name, "a red cube")[0])


def test_captions_by_camera_are_one_vector_a_side(clip: str, tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    four = desk.encode(clip, "guidance.captions=views")
    np.testing.assert_array_equal(four, spoken(clip, *view_captions("a red cube")))
    assert four.shape == (4, 24) and len(np.unique(four, axis=0)) == 4 and desk.said == []


def test_wordings_are_averaged_for_each_side(clip: str, tmp_path: Path) -> None:
    four = Desk(tmp_path).encode(clip, "guidance.captions=views", 'guidance.templates=["{}", "a photo of {}"]')
    for row, said in zip(four, view_captions("a red cube")):
        mean = spoken(clip, said, f"a photo of {said}").mean(axis=0)
        np.testing.assert_allclose(row, mean / np.linalg.norm(mean), atol=1e-5)


def test_words_that_the_settings_add_and_the_model_lacks_are_named(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    assert desk.encode("embedded", "guidance.captions=views").shape[0] == 4
    (note,) = [event["text"] for event in desk.said if event["event"] == "note"]
    assert "does not know back, front, overhead, side, view, which the settings add" in note


def test_a_caption_that_is_cut_is_told_to_whoever_dreams_it(clip: str, tmp_path: Path) -> None:
    desk, long = Desk(tmp_path), ", ".join(["a red cube in the snow"] * 12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        desk.encode(clip, "guidance.captions=views", caption=long)
    (note,) = [event["text"] for event in desk.said if event["event"] == "note"]
    assert re.fullmatch(
        r'clip reads 75 tokens and this caption has \d+: it is cut after "\.\.\. .*the snow.*" \(3 more wordings or captions are cut too\)',
        note,
    )
    desk.encode(clip, caption="a red cube in the snow")
    assert len(desk.said) == 1


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("guidance.captions=sides", "guidance.captions: input should be 'plain' or 'views', got 'sides'"),
        ('guidance.templates=["a photo"]', r'guidance.templates: expected wordings with \{\} where the caption goes, got "a photo"'),
        ("guidance.templates=[]", "guidance.templates: tuple should have at least 1 item"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(setting: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as refused:
        tiny(setting)
    assert "\n" not in str(refused.value)


def test_the_judges_score_does_not_read_what_guides() -> None:
    assert not [name for name in SCORE.reads if name.startswith("guidance")]

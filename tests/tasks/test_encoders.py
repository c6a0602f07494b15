"""Image-text models by name: shipped, published, several as one; known without being loaded, and refused in one sentence."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.guidance.architecture import UnfitModel
from flows.order import OrderError, take_order
from tasks.encoders import SHIPPED, EncoderError, card, describe_encoders, load_encoder, unknown_words
from tasks.provenance import licence
from tasks.published import find_published
from tasks.retries import is_passing
from tests.tasks import small_clip
from tests.tasks.tiny import tiny

QUICK = ("camera.views=1", "render.skip.enabled=false", "augment.copies=1", 'augment.backgrounds=["noise"]', "field.resolutions=[6]")
"""Little to compile."""


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("models")
    return str(small_clip.write(folder / "first")), str(small_clip.write(folder / "second", image_size=48, dim=40))


def test_a_card_is_the_model_without_its_weights(clips: tuple[str, str]) -> None:
    first, second = clips
    for name in (*SHIPPED, first, f"{first}*2", f"{first}+{second}*0.5", f"embedded+{first}"):
        known, model = card(name), load_encoder(name)
        assert (known.name, known.digest, known.image_size) == (name, model.digest, model.image_size)
    assert card(first).digest == card(f"{first}*2").digest == find_published(first).digest(eight_bits=False)
    assert card(f"{first}+{second}").image_size == 48
    assert len({card(f"{first}{end}").digest for end in ("", f"+{second}", f"+{second}*0.5")}) == 3


def test_a_card_starts_no_jax(clips: tuple[str, str]) -> None:
    program = "import sys; from tasks.encoders import card; card(sys.argv[1]); sys.exit('jax' in sys.modules)"
    subprocess.run([sys.executable, "-c", program, "+".join(clips)], check=True, cwd=Path(__file__).parents[2])


def test_only_the_tower_that_is_needed_is_loaded(clips: tuple[str, str]) -> None:
    model = load_encoder(clips[0], towers=("text",))
    assert "text" in model.params and "image" not in model.params
    with pytest.raises(UnfitModel, match="image tower"):
        model.encode_image(model.params, jnp.zeros((1, 32, 32, 3)))
    both = load_encoder("+".join(clips), towers=("image",))
    assert all("image" in params and "text" not in params for params in both.params)


def test_published_models_know_every_word(clips: tuple[str, str]) -> None:
    assert unknown_words(clips[0], "xyzzy") == unknown_words("+".join(clips), "xyzzy") == ()
    assert unknown_words(f"embedded+{clips[0]}", "a red zeppelin") == ("zeppelin",)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("klip", 'embedded, embedded-judge, published ones such as clip-.* got "klip"$'),
        ("clip-vit-b61", "clip-vit-b16.*dreamfields models"),
        ("clip-vit-b32", "HF_HUB_OFFLINE is set.*use --guidance embedded"),
        ("owner/name", "HF_HUB_OFFLINE is set"),
        ("./no-such-folder", "a folder that is there"),
        ("a/b/c", 'a folder that is there.* got "a/b/c"'),
        ("/" + 9999 * "a", "a folder that is there"),
        (9999 * "a", "an image-text model among"),
        ("embedded+klip", 'got "klip"'),
        ("embedded*0", "positive weight"),
        ("embedded+", "positive weight"),
    ],
)
def test_names_are_refused_in_one_sentence(name: str, words: str) -> None:
    for use in (card, load_encoder):
        with pytest.raises(EncoderError, match=words) as caught:
            use(name)
        assert "\n" not in str(caught.value) and str(caught.value).startswith("expected ")


def test_what_is_switched_off_is_not_tried_again() -> None:
    with pytest.raises(EncoderError, match="HF_HUB_OFFLINE is set") as caught:
        card("clip-vit-b32")
    assert not is_passing(caught.value)


def test_a_licence_is_known_by_name_and_else_of_their_own(tmp_path: Path) -> None:
    folder = tmp_path / "c++" / "clip*"
    folder.mkdir(parents=True)
    own = "a licence of their own"
    assert licence("embedded") == "Apache-2.0" and licence("embedded+owner/name*0.5") == f"Apache-2.0, {own}"
    assert licence(str(folder)) == own
    folder.rmdir()
    assert licence(str(folder)) == own, "a dream may be meshed again when the folder has gone"


def test_bad_files_are_refused_in_one_sentence(tmp_path: Path) -> None:
    folder = small_clip.write(tmp_path / "clip")
    weights = folder / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:-100])
    with pytest.raises(EncoderError, match=r"^expected a complete safetensors"):
        load_encoder(str(folder))
    (folder / "config.json").write_text('{"model_type": "blip"}')
    with pytest.raises(EncoderError, match='got "blip"'):
        card(str(folder))


def test_an_order_takes_folders_and_ensembles(clips: tuple[str, str], tmp_path: Path) -> None:
    order = take_order("xyzzy", guidance="+".join(clips), out=tmp_path)
    assert order.config.guidance.name == "+".join(clips) and order.unknown_words == ()
    take_order("a red mushroom", guidance=clips[0], judge=clips[0], out=tmp_path)
    with pytest.raises(OrderError, match="which guides it"):
        take_order("a red mushroom", guidance=f"embedded-judge+{clips[0]}", out=tmp_path)


def test_a_published_model_moves_the_field(clips: tuple[str, str]) -> None:
    words, eyes = load_encoder(clips[0], towers=("text",)), load_encoder(clips[0], towers=("image",))
    text = jax.jit(words.encode_text)(words.params, jnp.asarray(words.tokenize(["a red cube"])))[0]
    program = DreamProgram(tiny(*QUICK), eyes)
    start = program.start()
    before = jax.device_get(start.params)
    state, metrics = program.step(start, text)
    assert np.isfinite(float(metrics["loss"])) and int(state.bad) == 0 and -1 <= float(metrics["similarity"]) <= 1
    assert any(not np.array_equal(a, b) for a, b in zip(jax.tree.leaves(before), jax.tree.leaves(jax.device_get(state.params))))


def test_every_model_is_described() -> None:
    rows = describe_encoders()
    assert [row["name"] for row in rows[:2]] == list(SHIPPED) and all(row["on_disk"] for row in rows[:2])
    assert {"clip-vit-b16", "lit-b16b"} <= {row["name"] for row in rows}
    assert all(row.keys() == rows[0].keys() for row in rows)

"""Files: found, mapped, verified; and each kind of bad one refused in one clear sentence, nothing half-loaded."""

from __future__ import annotations

import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import plain_folder
import pytest
from safetensors.numpy import save_file

from dreamfields_core.guidance.architecture import UnfitModel
from storage.errors import MissingWeights, StorageError, UnreadableWeights
from storage.mapped import map_arrays
from storage.published import NotPublished
from tasks.published import describe_models, find_published, is_published, load_published


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plain_folder.write(tmp_path_factory.mktemp("models") / "small-clip")


@pytest.fixture
def folder(pristine: Path, tmp_path: Path) -> Path:
    """A copy that a test may damage."""
    for path in pristine.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def edit(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    settings = plain_folder.config()
    change(settings)
    (folder / "config.json").write_text(json.dumps(settings), encoding="utf-8")


def rewrite(folder: Path, change: Callable[[dict[str, np.ndarray]], Any]) -> None:
    arrays = plain_folder.arrays(plain_folder.config())
    change(arrays)
    save_file(arrays, folder / "model.safetensors")


def cut(folder: Path) -> None:
    path = folder / "model.safetensors"
    path.write_bytes(path.read_bytes()[:-1000])


def as_pickle(folder: Path) -> None:
    (folder / "model.safetensors").write_bytes(pickle.dumps({"weight": [1.0]}))


def as_torch_zip(folder: Path) -> None:
    with zipfile.ZipFile(folder / "model.safetensors", "w") as archive:
        archive.writestr("archive/data.pkl", pickle.dumps({}))


def only_pickle(folder: Path) -> None:
    (folder / "model.safetensors").rename(folder / "pytorch_model.bin")


def sentence(kind: type[Exception], words: str, name: str) -> None:
    """The error is of this kind, one line, and says what was expected, what came, and the way out."""
    with pytest.raises(kind, match=words) as caught:
        load_published(name)
    text = str(caught.value)
    assert ("\n" not in text and len(text) < 500 and "xpected" in text and "got" in text) or "found" in text, text


DAMAGE: dict[str, tuple[Callable[[Path], Any], type[Exception], str]] = {
    "truncated": (cut, UnreadableWeights, "complete safetensors.*fetch the file again"),
    "empty file": (lambda f: (f / "model.safetensors").write_bytes(b""), UnreadableWeights, "complete safetensors"),
    "a web page": (lambda f: (f / "model.safetensors").write_bytes(b"<html>404</html>"), UnreadableWeights, "complete safetensors"),
    "a pickle under its name": (as_pickle, UnreadableWeights, "pickle file under its name: use the model's .safetensors"),
    "a newer pickle": (
        lambda f: (f / "model.safetensors").write_bytes(pickle.dumps({"weight": [1.0]}, protocol=5)),
        UnreadableWeights,
        "pickle file under its name",
    ),
    "a torch zip under its name": (as_torch_zip, UnreadableWeights, "PyTorch or pickle file"),
    "pickled only": (only_pickle, UnreadableWeights, "a pickle, which runs code when it is loaded"),
    "missing array": (
        lambda f: rewrite(f, lambda a: a.pop("vision_model.encoder.layers.1.mlp.fc2.bias")),
        UnfitModel,
        r'"vision_model.encoder.layers.1.mlp.fc2.bias" being the first',
    ),
    "extra array": (lambda f: rewrite(f, lambda a: a.update(extra=np.ones(2, np.float32))), UnfitModel, r'1 more, "extra" the first'),
    "another depth": (lambda f: edit(f, lambda s: s["vision_config"].update(num_hidden_layers=1)), UnfitModel, "more, .*another model"),
    "another width": (
        lambda f: edit(f, lambda s: s["vision_config"].update(hidden_size=48)),
        UnfitModel,
        "got .*of another size",
    ),
    "another patch": (lambda f: edit(f, lambda s: s["vision_config"].update(patch_size=8)), UnfitModel, "of another size"),
    "integers": (lambda f: rewrite(f, lambda a: a.update(logit_scale=np.array(1))), UnfitModel, "expected real numbers"),
    "another family": (lambda f: edit(f, lambda s: s.update(model_type="blip")), UnfitModel, 'type clip or siglip, got "blip"'),
    "NaFlex": (lambda f: edit(f, lambda s: s.update(model_type="siglip2")), UnfitModel, "NaFlex"),
    "unknown activation": (lambda f: edit(f, lambda s: s["text_config"].update(hidden_act="relu6")), UnfitModel, 'got "relu6"'),
    "heads that do not divide": (lambda f: edit(f, lambda s: s["text_config"].update(num_attention_heads=3)), UnfitModel, "heads divide"),
    "values of wrong kinds": (lambda f: edit(f, lambda s: s.update(vision_config=[1])), UnfitModel, "wrong kinds"),
    "no JSON": (lambda f: (f / "config.json").write_text("{"), UnfitModel, "expected JSON"),
    "no object": (lambda f: (f / "config.json").write_text("[]"), UnfitModel, "expected a JSON object"),
    "no tokenizer": (lambda f: (f / "merges.txt").unlink(), MissingWeights, "vocab.json and merges.txt"),
    "merges of another model": (lambda f: (f / "merges.txt").write_text("zz qq\n"), UnfitModel, "merges that fit"),
    "vocabulary too large": (lambda f: edit(f, lambda s: s["text_config"].update(vocab_size=100)), UnfitModel, "of shape|tokens below"),
    "no weights": (lambda f: (f / "model.safetensors").unlink(), MissingWeights, "add what is missing"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_bad_files_are_refused_in_one_sentence(damage: str, folder: Path) -> None:
    harm, kind, words = DAMAGE[damage]
    harm(folder)
    sentence(kind, words, str(folder))


def test_names_that_mean_nothing(tmp_path: Path) -> None:
    sentence(NotPublished, "`dreamfields models` lists the names", "clip-vit-z99")
    (tmp_path / "empty").mkdir()
    sentence(MissingWeights, "found it empty", str(tmp_path / "empty"))
    assert is_published("clip-vit-b32") and is_published("owner/name") and is_published(str(tmp_path)) and not is_published("embedded")


def test_a_folder_loads_and_its_digest_tells_models_apart(pristine: Path, folder: Path) -> None:
    import jax

    model = load_published(str(pristine))
    assert (model.name, model.image_size, model.dim) == ("small-clip", 32, 24)
    picture, tokens = np.zeros((2, 20, 20, 3), np.float32), model.tokenize(["a red cube", "snow"])
    image, text = jax.jit(model.encode_image)(model.params, picture), jax.jit(model.encode_text)(model.params, tokens)
    np.testing.assert_allclose(np.linalg.norm(image, axis=1), 1, rtol=1e-5)
    assert image.shape == text.shape == (2, 24)
    assert find_published(str(folder)).digest() == model.digest
    assert find_published(str(folder)).digest(eight_bits=True) != model.digest
    rewrite(folder, lambda arrays: arrays["logit_scale"].fill(1))
    assert find_published(str(folder)).digest() != model.digest


def test_weights_cut_into_several_files(folder: Path) -> None:
    arrays = plain_folder.arrays(plain_folder.config())
    parts = {"model-00001-of-00002.safetensors": sorted(arrays)[::2], "model-00002-of-00002.safetensors": sorted(arrays)[1::2]}
    for name, keys in parts.items():
        save_file({key: arrays[key] for key in keys}, folder / name)
    whole = load_published(str(folder))
    (folder / "model.safetensors").unlink()
    index = {"weight_map": {key: name for name, keys in parts.items() for key in keys}}
    (folder / "model.safetensors.index.json").write_text(json.dumps(index))
    loaded = load_published(str(folder))
    np.testing.assert_array_equal(loaded.params["image"]["project"]["kernel"], whole.params["image"]["project"]["kernel"])
    (folder / "model-00002-of-00002.safetensors").unlink()
    sentence(MissingWeights, "model-00002-of-00002.safetensors beside", str(folder))


def test_npz_without_pickle(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{"params/img/cls": np.zeros((1, 1, 4), np.float32)})
    assert map_arrays([tmp_path / "a.npz"]).shapes == {"img/cls": (1, 1, 4)}
    np.savez(tmp_path / "b.npz", evil=np.array([{}], dtype=object))
    with pytest.raises(UnreadableWeights, match="as a pickle, which runs code"):
        map_arrays([tmp_path / "b.npz"])
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "c.npz").write_bytes(data[:-30])
    with pytest.raises(UnreadableWeights, match="complete npz"):
        map_arrays([tmp_path / "c.npz"])
    (tmp_path / "a.txt").write_text("[CLS]\n[UNK]")
    (tmp_path / "b.npz").unlink(), (tmp_path / "c.npz").unlink()
    with pytest.raises(UnfitModel, match="expected the arrays of a published LiT"):
        load_published(str(tmp_path))


def test_every_short_name_is_described_and_says_in_one_sentence_that_there_is_no_network() -> None:
    rows = describe_models()
    assert {"clip-vit-b16", "siglip2-base-patch16-256", "lit-b16b"} <= {row["name"] for row in rows}
    for row in rows:
        assert row["licence"] and row["megabytes"] > 100 and not row["on_disk"]
        with pytest.raises(StorageError, match=r"HF_HUB_OFFLINE is set.*use --guidance embedded, or ") as caught:
            load_published(row["name"])
        assert "\n" not in str(caught.value)

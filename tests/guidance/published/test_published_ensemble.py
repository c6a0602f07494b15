"""Several models as one, captions by camera, and wordings."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import plain_folder
import pytest

from dreamfields_core.guidance.ensemble import ensemble, split_name
from dreamfields_core.guidance.views import VIEWS, caption_embedding, embedding_at, view_captions, view_embeddings, view_index
from dreamfields_core.types import Encoder
from tasks.published import load_published


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Encoder, Encoder]:
    folder = tmp_path_factory.mktemp("models")
    wide = plain_folder.config(projection_dim=40, vision_config=plain_folder.CONFIG["vision_config"] | {"image_size": 48})
    return load_published(str(plain_folder.write(folder / "first"))), load_published(str(plain_folder.write(folder / "second", wide)))


def test_cosines_of_an_ensemble_are_the_weighted_mean(two: tuple[Encoder, Encoder]) -> None:
    both = ensemble([(two[0], 3.0), (two[1], 1.0)])
    assert (both.dim, both.image_size) == (64, 48) and both.digest != ensemble([(two[0], 1.0), (two[1], 1.0)]).digest
    images, captions = np.random.default_rng(0).random((3, 40, 40, 3), np.float32), ["a red cube", "snow", "two zebras drink"]

    def cosines(model: Encoder) -> np.ndarray:
        tokens = jnp.asarray(model.tokenize(captions))
        seen, said = jax.jit(model.encode_image)(model.params, images), jax.jit(model.encode_text)(model.params, tokens)
        np.testing.assert_allclose(np.linalg.norm(seen, axis=1), 1, rtol=1e-5)
        return np.asarray(seen @ said.T)

    np.testing.assert_allclose(cosines(both), 0.75 * cosines(two[0]) + 0.25 * cosines(two[1]), atol=1e-5)
    with pytest.raises(ValueError, match="positive weights"):
        ensemble([(two[0], 0.0)])


def test_names_of_ensembles() -> None:
    assert split_name("clip-vit-b16") == [("clip-vit-b16", 1.0)]
    assert split_name("clip-vit-b16*2 + siglip2-base-patch16-256*0.5") == [("clip-vit-b16", 2.0), ("siglip2-base-patch16-256", 0.5)]
    for name in ("", "a+", "a*x", "a*-1", "a*nan", "*2"):
        with pytest.raises(ValueError, match="positive weight"):
            split_name(name)


def test_each_camera_gets_its_caption(two: tuple[Encoder, Encoder]) -> None:
    assert view_captions("a bust of a woman.") == tuple(f"a bust of a woman, {view}" for view in VIEWS)
    azimuth = jnp.deg2rad(jnp.array([0.0, 44.0, 46.0, -90.0, 134.0, 136.0, 180.0, 359.0, 725.0, 10.0]) - 90.0)
    elevation = jnp.deg2rad(jnp.array([0.0] * 9 + [70.0]))
    np.testing.assert_array_equal(view_index(azimuth, elevation), [0, 0, 1, 1, 1, 2, 2, 0, 0, 3])
    np.testing.assert_array_equal(view_index(azimuth[:1], elevation[:1], front=np.pi / 2), [2])
    four = view_embeddings(two[0], "a bust")
    chosen = jax.jit(embedding_at)(four, azimuth, elevation)
    np.testing.assert_array_equal(chosen[4], four[1])
    np.testing.assert_array_equal(embedding_at(four[0], azimuth, elevation), jnp.tile(four[0], (10, 1)))


def test_wordings_are_averaged(two: tuple[Encoder, Encoder]) -> None:
    model = two[0]
    single = jax.jit(model.encode_text)(model.params, jnp.asarray(model.tokenize(["a red cube"])))[0]
    np.testing.assert_array_equal(caption_embedding(model, "a red cube"), single)
    mean = caption_embedding(model, "a red cube", templates=("{}", "a photo of {}"))
    assert float(jnp.linalg.norm(mean)) == pytest.approx(1, abs=1e-5) and float(mean @ single) < 1 - 1e-6
    with pytest.raises(ValueError, match="where the caption goes"):
        caption_embedding(model, "a red cube", templates=("a photo",))


def dream(path: Path, steps: int, **render: int) -> list[dict[str, float]]:
    """A few steps under the model in a folder, on the real program."""
    from dreamfields_core.config import override
    from dreamfields_core.dreaming.program import DreamProgram
    from dreamfields_core.presets import PRESETS

    model = load_published(str(path))
    text = jax.jit(model.encode_text)(model.params, jnp.asarray(model.tokenize(["a red cube"])))[0]
    settings = tuple(f"render.{name}={value}" for name, value in render.items())
    program = DreamProgram(override(next(iter(PRESETS.values())), (*settings, "augment.copies=2")), model)
    state, rows = program.start(), []
    for _ in range(steps):
        state, metrics = program.step(state, text)
        rows.append({name: float(value) for name, value in jax.device_get(metrics).items()})
    return rows


@pytest.mark.slow
def test_a_dream_steps_under_clip_b32_of_random_weights(tmp_path: Path) -> None:
    """The size of the real one: it proves the path and makes no object."""
    image = {"hidden_size": 768, "num_hidden_layers": 12, "num_attention_heads": 12, "intermediate_size": 3072, "image_size": 224}
    text = {"hidden_size": 512, "num_hidden_layers": 12, "num_attention_heads": 8, "intermediate_size": 2048, "vocab_size": 49408}
    settings = {"model_type": "clip", "projection_dim": 512, "vision_config": image | {"patch_size": 32}, "text_config": text}
    rows = dream(plain_folder.write(tmp_path / "clip-vit-b32", settings), 2, size=64, crop=56, samples=32)
    assert all(np.isfinite(row["loss"]) and row["bad"] == 0 for row in rows)

"""Captions by camera: every augmented copy is compared with the caption of the side that its own camera sees."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import DreamConfig, HybridConfig, validate
from dreamfields_core.dreaming.losses import cosines
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.guidance.views import embedding_at
from dreamfields_core.scene.cameras import Pose, sample_poses
from dreamfields_core.types import Array, Encoder

VIEWS, COPIES = 3, 2
DIM = VIEWS * COPIES

WHO_IS_WHO = Encoder(
    name="who is who",
    digest="0" * 64,
    image_size=4,
    dim=DIM,
    params=jnp.eye(DIM),
    tokenize=lambda captions: np.zeros((len(captions), 1), np.int32),
    encode_text=lambda params, tokens: jnp.zeros((tokens.shape[0], DIM)),
    encode_image=lambda params, images: params[: images.shape[0]] + 0.0 * jnp.sum(images),
)
"""Calls the first picture (1, 0, ...), the second (0, 1, ...): a cosine then tells which caption stood beside which copy."""


def config() -> DreamConfig:
    return validate(
        {
            "field": HybridConfig(resolutions=(2, 4), features=2, width=4).model_dump(),
            "camera": {"views": VIEWS, "elevation": {"low": 40.0, "high": 80.0}},
            "render": {"size": 6, "crop": 5, "samples": 4, "skip": {"enabled": False, "resolution": 4, "chunk": 256}},
            "augment": {"copies": COPIES, "backgrounds": ["white"]},
            "optim": {"steps": 8},
        }
    )


@pytest.fixture(scope="module")
def program() -> DreamProgram:
    return DreamProgram(config(), WHO_IS_WHO)


def drawn(step: int) -> Pose:
    """The cameras of a step, as every step draws them: from the first of four keys."""
    return sample_poses(jax.random.split(jax.random.fold_in(jax.random.key(config().seed), step), 4)[0], config().camera)


def side(azimuth: float, elevation: float) -> int:
    """Front, side, back, overhead, in degrees and one camera at a time; the front is seen from -Y."""
    if elevation > 60:
        return 3
    away = abs((azimuth + 90 + 180) % 360 - 180)
    return 0 if away <= 45 else 2 if away >= 135 else 1


def similarities(program: DreamProgram, text: Array, steps: int) -> list[float]:
    state, found = program.start(), []
    for _ in range(steps):
        state, metrics = program.step(state, text)
        assert int(state.bad) == 0 and np.isfinite(float(metrics["loss"]))
        found.append(float(metrics["similarity"]))
    return found


def test_each_copy_is_compared_with_the_caption_of_its_own_camera(program: DreamProgram) -> None:
    four = np.random.default_rng(0).normal(size=(4, DIM)).astype(np.float32)
    seen, wanted = set(), []
    for step in range(8):
        pose = drawn(step)
        sides = [side(*np.rad2deg([float(pose.azimuth[view]), float(pose.elevation[view])])) for view in range(VIEWS)]
        wanted.append(np.mean([four[sides[copy // COPIES], copy] for copy in range(DIM)]))
        seen |= set(sides)
    assert seen == {0, 1, 2, 3}
    np.testing.assert_allclose(similarities(program, jnp.asarray(four), 8), wanted, atol=1e-6)


@pytest.mark.slow
def test_four_times_the_same_caption_is_the_plain_one(program: DreamProgram) -> None:
    plain = jnp.asarray(np.random.default_rng(1).normal(size=DIM), jnp.float32)
    np.testing.assert_allclose(similarities(program, jnp.tile(plain, (4, 1)), 1), similarities(program, plain, 1), atol=1e-6)


def test_the_gradient_leads_each_copy_to_its_own_caption() -> None:
    rng = np.random.default_rng(2)
    copies, four = jnp.asarray(rng.normal(size=(3, 5)), jnp.float32), jnp.asarray(rng.normal(size=(4, 5)), jnp.float32)
    azimuth, elevation = jnp.deg2rad(jnp.array([-90.0, 90.0, 10.0])), jnp.deg2rad(jnp.array([0.0, 30.0, 89.0]))
    gradient = jax.jit(jax.grad(lambda images: jnp.mean(cosines(images, embedding_at(four, azimuth, elevation)))))(copies)
    np.testing.assert_allclose(gradient, np.asarray(four)[[0, 2, 3]] / 3, rtol=1e-6)

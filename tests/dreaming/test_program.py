"""Whole dreams, very small, with a linear map for an encoder: they learn, repeat, resume and survive what is not a number."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.config import DreamConfig, HybridConfig, ResidualMLPConfig, validate
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import DreamState, state_from_arrays, state_to_arrays
from dreamfields_core.rendering.images import on_white, view_renderer
from dreamfields_core.scene.cameras import poses_at
from dreamfields_core.types import Array, Encoder

FIELDS = {
    "residual_mlp": ResidualMLPConfig(frequencies=6, levels=3.0, width=16, bottleneck=16, blocks=1),
    "hybrid": HybridConfig(resolutions=(2, 4), features=4, width=8),
}
STEPS = 30


def encode_image(params: Array, images: Array) -> Array:
    """A linear map of what differs from grey, on the sphere."""
    small = jax.image.resize(images, (images.shape[0], 4, 4, 3), "linear").reshape(images.shape[0], -1)
    mapped = (small - 0.5) @ params
    return mapped / jnp.sqrt(jnp.sum(mapped**2, axis=-1, keepdims=True) + 1e-6)


ENCODER = Encoder(
    name="linear",
    digest="0" * 64,
    image_size=4,
    dim=6,
    params=jnp.asarray(np.random.default_rng(0).normal(size=(48, 6)), jnp.float32),
    tokenize=lambda captions: np.zeros((len(captions), 1), np.int32),
    encode_text=lambda params, tokens: jnp.zeros((tokens.shape[0], 6)),
    encode_image=encode_image,
)
TEXT = encode_image(ENCODER.params, jnp.tile(jnp.asarray([0.9, 0.2, 0.1])[None, None, None, :], (1, 4, 4, 1)))[0]
"""What the encoder says of a red picture."""


def config_of(field: str, **changes: object) -> DreamConfig:
    skip = {"warmup_steps": 8, "refresh_every": 4, "resolution": 4, "chunk": 256}
    values = {
        "field": FIELDS[field].model_dump(),
        "camera": {"views": 2, "elevation": {"low": 10.0, "high": 40.0}},
        "render": {"size": 8, "crop": 7, "samples": 8, "skip": skip},
        "augment": {"copies": 2, "blur": 2.0, "checkers": 4},
        "loss": {"anneal_steps": 10},
        "optim": {"steps": STEPS, "rate_start": 2e-2, "rate": 2e-2, "warmup_steps": 0},
    }
    return validate(values | changes)


class Run:
    """One compiled program and the dream of it, start to end."""

    def __init__(self, config: DreamConfig) -> None:
        self.program = DreamProgram(config, ENCODER)
        self.first = state_to_arrays(self.program.start())
        self.middle: dict[str, np.ndarray] = {}
        self.losses: list[float] = []
        self.metrics: list[dict] = []
        state = self.program.start()
        for step in range(STEPS):
            if step == STEPS // 2:
                # A copy, as a checkpoint on disk would be: the step consumes its state.
                self.middle = {name: array.copy() for name, array in state_to_arrays(state).items()}
            state, metrics = self.program.step(state, TEXT)
            self.metrics.append({name: float(value) for name, value in metrics.items()})
        self.last = state_to_arrays(state)

    def on(self, arrays: dict[str, np.ndarray], steps: int, text: Array = TEXT) -> tuple[DreamState, dict]:
        state = state_from_arrays(self.program.start(), arrays)
        for _ in range(steps):
            state, metrics = self.program.step(state, text)
        return state, metrics


@pytest.fixture(scope="module", params=FIELDS)
def run(request: pytest.FixtureRequest) -> Run:
    return Run(config_of(request.param))


def assert_same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def test_it_learns(run: Run) -> None:
    similarities = [metrics["similarity"] for metrics in run.metrics]
    assert all(np.isfinite(value) for metrics in run.metrics for value in metrics.values())
    # Views and backgrounds differ from step to step: five at either end.
    assert np.mean(similarities[-5:]) > np.mean(similarities[:5]) + 0.1, similarities
    assert np.mean([m["loss"] for m in run.metrics[-5:]]) < np.mean([m["loss"] for m in run.metrics[:5]])


def test_metrics_say_what_happened(run: Run) -> None:
    first = run.metrics[0]
    loss = -first["similarity"] - 0.5 * min(first["transmittance"], first["target"])
    # The two views' means are clipped apart and the field's own penalty is added: near, not equal.
    assert first["loss"] == pytest.approx(loss, abs=0.1)
    assert first["target"] == pytest.approx(0.4, abs=1e-5) and run.metrics[-1]["target"] == pytest.approx(0.88, abs=1e-5)
    assert first["rate"] == pytest.approx(2e-2) and first["bad"] == 0
    assert all(0 <= metrics["evaluated"] <= 1 and 0 <= metrics["transmittance"] <= 1 for metrics in run.metrics)


def test_state_after_all_steps(run: Run) -> None:
    assert int(run.last["step"]) == STEPS and int(run.last["bad"]) == 0
    assert bool(run.last["occupancy/known"]) and not bool(run.first["occupancy/known"])
    assert np.any(run.last["origin"] != 0) and np.abs(run.last["origin"]).max() < 0.1
    for name in run.first:
        if name.startswith("params") and "frequencies" not in name:
            assert np.any(run.first[name] != run.last[name]), name
        elif "frequencies" in name and name.startswith("params"):
            np.testing.assert_array_equal(run.first[name], run.last[name])


def test_resumed_in_the_middle_it_ends_bit_for_bit_the_same(run: Run) -> None:
    resumed, _ = run.on(run.middle, STEPS - STEPS // 2)
    assert_same(state_to_arrays(resumed), run.last)


def test_the_same_seed_dreams_the_same_and_another_does_not(run: Run) -> None:
    again, _ = run.on(run.first, 3)
    other = DreamProgram(run.program.config.model_copy(update={"seed": 1}), ENCODER).start()
    repeated, _ = run.on(state_to_arrays(run.program.start()), 3)
    assert_same(state_to_arrays(again), state_to_arrays(repeated))
    different = [name for name, array in state_to_arrays(other).items() if not np.array_equal(array, run.first[name])]
    assert any(name.startswith("params") for name in different)


def test_what_is_not_a_number_changes_nothing_and_is_counted(run: Run) -> None:
    for count, text in ((1, jnp.full(6, jnp.nan)), (3, jnp.full(6, jnp.inf))):
        state, metrics = run.on(run.middle, count, text)
        after = state_to_arrays(state)
        assert int(after.pop("bad")) == count == int(metrics["bad"])
        assert int(after.pop("step")) == int(run.middle["step"]) + count
        assert_same(after, {name: array for name, array in run.middle.items() if name not in ("bad", "step")})
        recovered, metrics = run.program.step(state, TEXT)
        assert int(recovered.bad) == 0 and np.isfinite(metrics["loss"])


def test_a_smaller_rate_after_a_roll_back_moves_less(run: Run) -> None:
    moves = []
    for scale in (1.0, 0.5, 0.0):
        state, _ = run.on(run.middle | {"rate_scale": np.float32(scale)}, 1)
        after = state_to_arrays(state)
        moves.append(np.sqrt(sum(np.sum((after[n] - run.middle[n]) ** 2) for n in after if n.startswith("params"))))
    assert moves[1] == pytest.approx(0.5 * moves[0], rel=1e-4) and moves[2] == 0.0


def test_a_preview_is_a_picture_and_leaves_the_state_alone(run: Run) -> None:
    state = state_from_arrays(run.program.start(), run.last)
    picture = run.program.preview(state)
    assert picture.shape == (8, 8, 3) and picture.dtype == np.uint8
    assert_same(state_to_arrays(state), run.last)
    np.testing.assert_array_equal(picture, run.program.preview(state))


def seen(program: DreamProgram, state: DreamState, elevation: float, *, radius: float, focal: float) -> np.ndarray:
    """What the renderer of finished fields sees from azimuth 30 degrees, on white, in 0 ... 255."""
    pose = jax.tree.map(lambda leaf: leaf[0], poses_at([30.0], elevation, radius=radius, focal=focal))
    skip, bound, samples = program.config.render.skip, program.config.scene.bound, program.config.render.samples
    see = view_renderer(program.field, state.params, state.origin, state.occupancy, samples=samples, bound=bound, skip=skip)
    return 255 * on_white(see(pose, 8))


def test_a_preview_stands_where_training_does_however_the_object_is_judged(run: Run) -> None:
    state = state_from_arrays(run.program.start(), run.last)
    judged_afar = config_of(
        run.program.config.field.kind,
        camera=run.program.config.camera.model_dump() | {"radius": {"low": 3.0, "high": 5.5}},
        evaluate={"radius": 9.0},
    )
    program = DreamProgram(judged_afar, ENCODER)
    wanted = seen(program, state, 25.0, radius=4.25, focal=1.2 * 1111.1111 / 800)
    assert np.ptp(wanted) > 10
    np.testing.assert_allclose(program.preview(state), wanted, atol=0.6)


def test_a_glimpse_is_the_papers_held_out_view(run: Run) -> None:
    state = state_from_arrays(run.program.start(), run.last)
    glimpse = run.program.glimpse(state)
    assert glimpse.dtype == np.uint8 and np.ptp(glimpse) > 0
    np.testing.assert_allclose(glimpse, seen(run.program, state, 45.0, radius=4.0, focal=1111.1111 / 800), atol=0.6)
    assert_same(state_to_arrays(state), run.last)


@pytest.mark.slow
def test_seeds_differ_from_the_first_step_on() -> None:
    losses = []
    for seed in (0, 1, 2**32 - 1):
        program = DreamProgram(config_of("hybrid", seed=seed), ENCODER)
        # Same parameters: what differs then is what the step draws.
        state = program.start().replace(params=DreamProgram(config_of("hybrid"), ENCODER).start().params)
        losses.append(float(program.step(state, TEXT)[1]["loss"]))
    assert len(set(losses)) == 3


@pytest.mark.slow
@pytest.mark.parametrize("regularizer", ["density_noise", "clipped_gated", "beta_prior"])
def test_it_learns_with_other_regularisers_too(regularizer: str) -> None:
    run = Run(config_of("hybrid", loss={"regularizer": regularizer, "anneal_steps": 10, "noise_steps": 20}))
    similarities = [metrics["similarity"] for metrics in run.metrics]
    assert all(np.isfinite(value) for metrics in run.metrics for value in metrics.values())
    assert np.mean(similarities[-5:]) > np.mean(similarities[:5]) + 0.1, similarities
    resumed, _ = run.on(run.middle, STEPS - STEPS // 2)
    assert_same(state_to_arrays(resumed), run.last)


@pytest.mark.slow
def test_the_origin_stays_where_it_is_not_tracked() -> None:
    program = DreamProgram(config_of("hybrid", scene={"track_origin": False}), ENCODER)
    state, _ = program.step(program.start(), TEXT)
    np.testing.assert_array_equal(state.origin, 0.0)

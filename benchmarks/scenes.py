"""Scenes that were really dreamed, made once and kept in a cache.

`dreamed` is a dream of the draft preset. `settled` is the paper's residual network in the same state: it is first fitted to a
dreamed object, opacity and colour at random points, and then dreams on by itself, so that its density, its memory of where the
scene is and its gradient are those of a dream that has formed, without the hours until then.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import optax

from dreamfields_core.config import DreamConfig, ResidualMLPConfig
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.dreaming.state import DreamState, state_to_arrays
from dreamfields_core.fields.contract import Field
from dreamfields_core.presets import preset
from dreamfields_core.rendering.occupancy import Occupancy, refresh, unknown_occupancy
from dreamfields_core.rendering.sampling import step_length
from dreamfields_core.types import Array, Encoder, Gaussians, Params
from storage.digests import json_digest
from tasks.compiled import cache_folder
from tasks.encoders import load_encoder
from tasks.finished_field import FinishedField, pack_field, unpack_field

CAPTION = "a red mushroom"
LENGTHS = (0.02, 0.1, 0.5)
"""World units over which opacities are compared when a field is fitted to another."""


def text_embedding(encoder: Encoder, caption: str) -> Array:
    """[dim] unit vector."""
    return jax.jit(encoder.encode_text)(encoder.params, jnp.asarray(encoder.tokenize([caption])))[0]


def dreamed(config: DreamConfig, *, caption: str = CAPTION) -> FinishedField:
    """A whole dream of `config`."""
    encoder = load_encoder(config.guidance.name)

    def make() -> bytes:
        program = DreamProgram(config, encoder)
        state, _ = dream_on(program, program.start(), text_embedding(encoder, caption), steps=config.optim.steps)
        return pack_field(state_to_arrays(state), config)

    return unpack_field(kept(_name(caption, config, encoder), make))


def settled(
    field: ResidualMLPConfig | None = None, *, source: DreamConfig | None = None, caption: str = CAPTION, fit_steps: int, dream_steps: int
) -> FinishedField:
    """A residual network that holds a dreamed object and has dreamed on for some steps.

    source: of the dream that it is fitted to; the draft preset's if None. fit_steps: of Adam on random points.
    dream_steps: at the source's resolution, with the paper's constant rate.
    """
    source = source or preset("draft")
    field = field or ResidualMLPConfig()
    config = source.model_copy(
        update={
            "field": field,
            "optim": source.optim.model_copy(update={"rate_start": 1e-4, "rate": 1e-4, "rate_end": None, "steps": max(dream_steps, 1)}),
        }
    )
    encoder = load_encoder(config.guidance.name)

    def make() -> bytes:
        target = dreamed(source, caption=caption)
        program = DreamProgram(config, encoder)
        start = program.start()
        params = fit(jax.random.key(1), program.field, start.params, target, steps=fit_steps)
        # As at the end of a dream: every schedule has run its course.
        begun = start.replace(params=params, step=jnp.int32(10 * config.loss.anneal_steps))
        begun = begun.replace(occupancy=remembered(program, begun))
        state, _ = dream_on(program, begun, text_embedding(encoder, caption), steps=dream_steps)
        return pack_field(state_to_arrays(state), config)

    return unpack_field(kept(_name(caption, config, encoder, _said(source), fit_steps, dream_steps), make))


def remembered(program: DreamProgram, state: DreamState, *, refreshes: int = 16) -> Occupancy:
    """What the program's occupancy grid knows of a scene that has stood still for so many refreshes."""
    config = program.config
    ask = jax.jit(partial(refresh, field=program.field, bound=config.scene.bound, decay=config.render.skip.decay))
    prepared = jax.jit(program.field.prepare)(state.params)
    occupancy = unknown_occupancy(config.render.skip.resolution)
    for number in range(refreshes):
        occupancy = ask(jax.random.key(number), occupancy, prepared=prepared, origin=state.origin)
    return occupancy


def dream_on(program: DreamProgram, state: DreamState, text: Array, *, steps: int) -> tuple[DreamState, list[dict[str, Array]]]:
    """So many steps; the metrics of each."""
    rows = []
    for _ in range(steps):
        state, metrics = program.step(state, text)
        rows.append(metrics)
    return state, rows


def fit(key: Array, field: Field, params: Params, target: FinishedField, *, steps: int, batch: int = 2048) -> Params:
    """Move `params` until the field's opacities over LENGTHS, and its colour where it is opaque, are the target's."""
    bound = target.config.scene.bound
    known = jax.jit(target.field.prepare)(target.params)
    adam = optax.adam(optax.cosine_decay_schedule(2e-3, steps, alpha=0.02))
    lengths = jnp.asarray(LENGTHS)[:, None]

    def seen(field: Field, prepared: Params, gaussians: Gaussians) -> tuple[Array, Array]:
        raw, color = field.apply(prepared, gaussians)
        return -jnp.expm1(-lengths * field.density(raw)[None, :]), color

    @jax.jit
    def step(key: Array, params: Params, moments: optax.OptState) -> tuple[Params, optax.OptState]:
        gaussians = random_gaussians(key, target.origin, bound=bound, count=batch)
        opacity, color = seen(target.field, known, gaussians)

        def error(params: Params) -> Array:
            own_opacity, own_color = seen(field, field.prepare(params), gaussians)
            return jnp.mean((own_opacity - opacity) ** 2) + jnp.mean(opacity[1][:, None] * (own_color - color) ** 2)

        update, moments = adam.update(jax.grad(error)(params), moments)
        return optax.apply_updates(params, update), moments

    moments = adam.init(params)
    for number in range(steps):
        params, moments = step(jax.random.fold_in(key, number), params, moments)
    return params


def random_gaussians(key: Array, origin: Array, *, bound: float, count: int) -> Gaussians:
    """Samples as cameras make them, anywhere in the cube: steps of 1/48 to 1/768 of its diagonal, pixels to match."""
    place_key, direction_key, size_key = jax.random.split(key, 3)
    directions = jax.random.normal(direction_key, (count, 3))
    step = step_length(bound=bound, count=48) * 2.0 ** -jax.random.uniform(size_key, (count,), maxval=4.0)
    return Gaussians(
        means=origin[None, :] + jax.random.uniform(place_key, (count, 3), minval=-bound, maxval=bound),
        directions=directions / jnp.linalg.norm(directions, axis=-1, keepdims=True),
        along=step**2 / 12.0,
        across=(step / 4.0) ** 2,
    )


def folder() -> Path:
    """Where made scenes are kept."""
    return cache_folder() / "benchmarks"


def _name(caption: str, config: DreamConfig, encoder: Encoder, *more: Any) -> str:
    """Digest of what decides a scene."""
    return json_digest([caption, config.field.kind, _said(config), encoder.digest, *more])


def _said(config: DreamConfig) -> Any:
    """What a field is made by, and of that only what is not at its default: a setting that is new makes no scene anew."""
    return config.model_dump(mode="json", exclude_defaults=True, exclude={"evaluate", "mesh"})


def kept(name: str, make: Callable[[], bytes], *, ending: str = "safetensors") -> bytes:
    """The bytes of that name, made if they are not there."""
    path = folder() / f"{name[:32]}.{ending}"
    if not path.is_file():
        data = make()
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_bytes(data)
        part.replace(path)
    return path.read_bytes()

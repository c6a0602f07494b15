"""One step of a dream (paper section 4.2): pose, render, augment, encode, compare, and move the field.

Everything random in step n comes from fold_in(key(seed), n), so a step is a pure function of the state, and a run that was
stopped goes on as if it had not been.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optax

from dreamfields_core.config import DreamConfig, EvaluateConfig
from dreamfields_core.dreaming.augmentations import augmented_copies
from dreamfields_core.dreaming.losses import cosines, regularized
from dreamfields_core.dreaming.schedules import density_noise, learning_rate, target_transmittance
from dreamfields_core.dreaming.state import DreamState
from dreamfields_core.fields import Field, build_field
from dreamfields_core.fields.perturbed import perturb, perturbed
from dreamfields_core.guidance.views import embedding_at
from dreamfields_core.precision import product_type
from dreamfields_core.rendering.images import on_white
from dreamfields_core.rendering.occupancy import Occupancy, refresh, refresh_some, unknown_occupancy
from dreamfields_core.rendering.render import Tally
from dreamfields_core.rendering.sharding import batch_over, device_mesh, on_every_device, render_rays_over
from dreamfields_core.scene.cameras import Pose, camera_rays, poses_at, sample_poses
from dreamfields_core.scene.origin import track_origin
from dreamfields_core.types import Array, Encoder, Params, Rays, Rendering

Metrics = dict[str, Array]
HELD_OUT = EvaluateConfig()
"""The paper's held-out view. Not the configuration's, since how an object is judged must not decide what is made on the way to it."""


class DreamProgram:
    """The compiled step for one configuration and one guidance model.

    `start` gives the state before the first step; `step` takes (state, text_embedding) to (state, metrics), without waiting for
    the device; `preview` renders a small picture. text_embedding: [dim], or [4, dim] for the views of guidance/views.py.

    On several devices (`mesh`) the rays and the encoder's pictures are dealt out, and all else is done on each.

    Raises:
      ValueError: `render.devices` cannot be had.
    """

    def __init__(self, config: DreamConfig, encoder: Encoder) -> None:
        self.config = config
        self.mesh = device_mesh(config.render.devices, rays=config.camera.views * config.render.size**2)
        products = product_type(config.render.products, jax.default_backend())
        self.field = build_field(config.field, bound=config.scene.bound, products=products)
        self.encoder = replace(encoder, params=on_every_device(self.mesh, encoder.params))
        self._adam = optax.scale_by_adam(eps=config.optim.epsilon)
        # The key is an argument of the compiled step: another seed is the same program.
        self._key = jax.random.key(config.seed)
        self._init = jax.jit(self.field.init)
        self._step = jax.jit(self.advance, donate_argnums=0)
        self._preview = jax.jit(self._render_preview)

    def start(self) -> DreamState:
        """The state before the first step; decided by the configuration's seed alone."""
        return on_every_device(self.mesh, self.start_from(self._key))

    def start_from(self, seed_key: Array) -> DreamState:
        """The state before the first step of another seed, jax.random.key(seed)."""
        params = self._init(jax.random.fold_in(seed_key, 2**31))
        return DreamState(
            step=jnp.zeros((), jnp.int32),
            params=params,
            opt_state=self._adam.init(params),
            origin=jnp.zeros(3),
            occupancy=unknown_occupancy(self.config.render.skip.resolution),
            rate_scale=jnp.ones(()),
            bad=jnp.zeros((), jnp.int32),
        )

    def step(self, state: DreamState, text_embedding: Array) -> tuple[DreamState, Metrics]:
        """Take one step; `state` is consumed. A step whose loss or gradient is not finite changes nothing but `bad`."""
        return self._step(on_every_device(self.mesh, state), self._key, self.encoder.params, text_embedding)

    def preview(self, state: DreamState, *, azimuth: float = 30.0) -> np.ndarray:
        """A picture of the training size on white, uint8 [H, W, 3], from the middle of where training's cameras stand."""
        camera = self.config.camera
        elevation, radius, focal = (0.5 * (drawn.low + drawn.high) for drawn in (camera.elevation, camera.radius, camera.focal))
        return self._picture(state, poses_at([azimuth], elevation, radius=radius, focal=focal))

    def glimpse(self, state: DreamState) -> np.ndarray:
        """The first held-out view of the paper, in the training size on white, uint8 [H, W, 3]."""
        pose = poses_at(HELD_OUT.azimuths[:1], HELD_OUT.elevation, radius=HELD_OUT.radius, focal=HELD_OUT.focal)
        return self._picture(state, pose)

    def advance(self, state: DreamState, seed_key: Array, encoder_params: Params, text_embedding: Array) -> tuple[DreamState, Metrics]:
        """`step` as a function of all that it reads, to be compiled."""
        optim, scene = self.config.optim, self.config.scene
        key = jax.random.fold_in(seed_key, state.step)
        pose_key, render_key, augment_key, occupancy_key = jax.random.split(key, 4)
        occupancy = self._occupancy(occupancy_key, state)
        pose = sample_poses(pose_key, self.config.camera)

        def objective(params: Params) -> tuple[Array, tuple[Metrics, Tally]]:
            prepared = self.field.prepare(params)
            field, seen = self._disturbed(render_key, prepared, state.step)
            views, tally = self._render(render_key, field, seen, pose, state.origin, occupancy)
            return self._loss(augment_key, prepared, views, tally, pose, state.step, encoder_params, text_embedding)

        (loss, (metrics, tally)), gradient = jax.value_and_grad(objective, has_aux=True)(state.params)
        finite = jnp.isfinite(loss) & jnp.isfinite(optax.tree.norm(gradient))
        direction, opt_state = self._adam.update(gradient, state.opt_state)
        rate = learning_rate(state.step, optim) * state.rate_scale
        moved = jax.tree.map(lambda value, update: value - rate * update, state.params, direction)
        origin = track_origin(state.origin, tally.mass, tally.moment, decay=scene.origin_decay) if scene.track_origin else state.origin
        keep = partial(jax.tree.map, lambda new, old: jnp.where(finite, new, old))
        after = DreamState(
            step=state.step + 1,
            params=keep(moved, state.params),
            opt_state=keep(opt_state, state.opt_state),
            origin=keep(origin, state.origin),
            occupancy=keep(occupancy, state.occupancy),
            rate_scale=state.rate_scale,
            bad=jnp.where(finite, 0, state.bad + 1),
        )
        return after, metrics | {"loss": loss, "rate": rate, "bad": after.bad}

    def _loss(
        self,
        key: Array,
        prepared: Params,
        views: Rendering,
        tally: Tally,
        pose: Pose,
        step: Array,
        encoder_params: Params,
        text_embedding: Array,
    ) -> tuple[Array, tuple[Metrics, Tally]]:
        """L_total with its regulariser (paper equation 9, table 2) + the field's own penalty."""
        config = self.config
        copies = batch_over(self.mesh, augmented_copies(key, views, augment=config.augment, crop=config.render.crop))
        scores = cosines(self.encoder.encode_image(encoder_params, copies), self._goal(text_embedding, pose))
        target = target_transmittance(step, pose, config.loss)
        penalty = self.field.penalty(jax.random.fold_in(key, 2**31), prepared)
        loss = regularized(scores, views.transmittance, target, config.loss) + penalty
        metrics = {
            "similarity": jnp.mean(scores),
            "transmittance": jnp.mean(views.transmittance),
            "target": jnp.mean(target),
            "evaluated": tally.evaluated / tally.possible,
        }
        return loss, (metrics, tally)

    def _goal(self, text_embedding: Array, pose: Pose) -> Array:
        """What the copies are compared with: the caption's [dim], or [V * copies, dim] by the side that each one's camera sees."""
        if text_embedding.ndim == 1:
            return text_embedding
        return jnp.repeat(embedding_at(text_embedding, pose.azimuth, pose.elevation), self.config.augment.copies, axis=0)

    def _disturbed(self, key: Array, prepared: Params, step: Array) -> tuple[Field, Params]:
        """The field that is rendered in training and what it reads; its density is perturbed where that is the regulariser."""
        if self.config.loss.regularizer != "density_noise":
            return self.field, prepared
        return perturbed(self.field), perturb(jax.random.fold_in(key, 2**31), prepared, density_noise(step, self.config.loss))

    def _render(
        self, key: Array | None, field: Field, prepared: Params, pose: Pose, origin: Array, occupancy: Occupancy
    ) -> tuple[Rendering, Tally]:
        """Views of shape [V, size, size]."""
        render = self.config.render
        rays = camera_rays(pose, origin, size=render.size)
        shape = rays.radii.shape[:-1]
        flat: Rays = jax.tree.map(lambda leaf: leaf.reshape(-1, leaf.shape[-1]), rays)
        rendering, tally = render_rays_over(
            key,
            self.mesh,
            field,
            prepared,
            flat,
            origin,
            occupancy,
            samples=render.samples,
            bound=self.config.scene.bound,
            skip=render.skip,
        )
        return jax.tree.map(lambda leaf: leaf.reshape(*shape, *leaf.shape[1:]), rendering), tally

    def _picture(self, state: DreamState, pose: Pose) -> np.ndarray:
        picture = on_white(jax.device_get(self._preview(state, pose)))
        # A field that is not a number, until it is rolled back, shows nothing: white.
        return np.round(255 * np.nan_to_num(picture[0], nan=1.0)).astype(np.uint8)

    def _render_preview(self, state: DreamState, pose: Pose) -> Rendering:
        return self._render(None, self.field, self.field.prepare(state.params), pose, state.origin, state.occupancy)[0]

    def _occupancy(self, key: Array, state: DreamState) -> Occupancy:
        """Refreshed every so often, once the object has begun to form."""
        skip = self.config.render.skip
        due = (state.step >= skip.warmup_steps) & (state.step % skip.refresh_every == 0)
        if not skip.enabled:
            return state.occupancy

        def ask() -> Occupancy:
            scene = (key, state.occupancy, self.field, self.field.prepare(state.params), state.origin)
            everywhere = partial(refresh, *scene, bound=self.config.scene.bound, decay=skip.decay)
            if skip.refresh_turns == 1:
                return everywhere()
            turn = state.step // skip.refresh_every
            some = partial(refresh_some, *scene, turn=turn, turns=skip.refresh_turns, bound=self.config.scene.bound, decay=skip.decay)
            return jax.lax.cond(state.occupancy.known, some, everywhere)

        return jax.lax.cond(due, ask, lambda: state.occupancy)

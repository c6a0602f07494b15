"""Films of what turns."""

from __future__ import annotations

import io

import jax.numpy as jnp
import numpy as np
from PIL import Image

from dreamfields_core.config import EvaluateConfig
from dreamfields_core.rendering.pictures import BACKDROP, webp_animation
from tasks.film import full_turn, mesh_turntable, mp4
from tests.meshing.textured import CENTRE, globe


def test_a_full_turn_does_not_repeat_its_first_view() -> None:
    assert full_turn(4) == (0.0, 90.0, 180.0, 270.0)


def test_a_mesh_turns_in_its_own_colours_before_the_backdrop() -> None:
    look = EvaluateConfig(picture_size=24, turntable_frames=4, elevation=0.0)
    frames = np.stack(mesh_turntable(globe(), jnp.asarray(CENTRE, jnp.float32), look))
    assert frames.shape == (4, 24, 24, 3) and frames.dtype == np.uint8
    behind = (frames == round(255 * BACKDROP)).all(axis=-1)
    # 0.9 against 0.6 half-axes: seen along one, the other is the width.
    widths = [int((~view).any(axis=0).sum()) for view in behind]
    assert widths[0] == widths[2] and widths[1] == widths[3] and abs(widths[1] - widths[0]) >= 3
    solid = frames[0][~behind[0]].astype(int)
    rows = np.nonzero(~behind[0])[0]
    assert solid[rows < 12, 0].mean() > solid[rows > 12, 0].mean() + 30  # red grows northward


def test_edges_are_between_the_object_and_the_backdrop() -> None:
    look = EvaluateConfig(picture_size=24, turntable_frames=1, elevation=0.0)
    fine = mesh_turntable(globe(), jnp.asarray(CENTRE, jnp.float32), look)[0][..., 2].astype(int)
    plain = {51, 204}
    assert len({int(value) for value in np.unique(fine)} - plain) >= 2


def test_the_same_frames_give_the_same_films() -> None:
    frames = [np.full((17, 16, 3), shade, np.uint8) for shade in (0, 100, 200)]
    assert mp4(frames) == mp4(frames) and mp4(frames)[4:8] == b"ftyp"
    with Image.open(io.BytesIO(webp_animation(frames))) as film:
        assert film.n_frames == 3  # type: ignore[attr-defined]

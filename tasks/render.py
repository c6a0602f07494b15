"""field -> pictures: the held-out views that are judged; a contact sheet and turntables for people."""

from __future__ import annotations

import io

import numpy as np

from dreamfields_core.config import EvaluateConfig
from dreamfields_core.png import png
from dreamfields_core.rendering.images import on_shade, on_white
from dreamfields_core.rendering.pictures import BACKDROP, contact_sheet, depth_shades, picture, transmittance_shades
from dreamfields_core.scene.cameras import Pose, poses_at
from dreamfields_core.types import Rendering
from tasks.film import full_turn, keep_films
from tasks.finished_field import unpack_field, view_by
from tasks.step import Made, Work


def views(work: Work) -> Made:
    """What a judge sees: the held-out views on white, with all samples."""
    look, dream = work.config.evaluate, unpack_field(work.read("field"))
    seen = view_by(dream, samples=look.samples)(_around(look, look.azimuths), work.number("size"))
    file = io.BytesIO()
    np.savez(file, views=on_white(seen).astype(np.float32), origin=np.asarray(dream.origin))
    return Made((work.keep("views.npz", file.getvalue(), "application/x-npz"),))


def render(work: Work) -> Made:
    """What people see, with half the samples."""
    look, dream = work.config.evaluate, unpack_field(work.read("field"))
    see = view_by(dream, samples=max(1, look.samples // 2))
    shown = see(_around(look, look.azimuths), look.picture_size)
    turning = see(_around(look, full_turn(look.turntable_frames)), look.picture_size)
    return Made(
        (
            work.keep("contact_sheet.png", png(contact_sheet(shown, work.text("caption"))), "image/png"),
            *(ref for name, frames in _turntables(turning).items() for ref in keep_films(work, name, frames)),
        ),
        {"opacity": float(1 - shown.transmittance.mean())},
    )


def _around(look: EvaluateConfig, azimuths: tuple[float, ...]) -> Pose:
    return poses_at(azimuths, look.elevation, radius=look.radius, focal=look.focal)


def _turntables(turning: Rendering) -> dict[str, list[np.ndarray]]:
    """One rendering gives all three: colour, depth and transmittance."""
    shades = {
        "turntable": on_shade(turning, BACKDROP),
        "turntable_depth": depth_shades(turning),
        "turntable_transmittance": transmittance_shades(turning),
    }
    return {name: list(picture(images)) for name, images in shades.items()}

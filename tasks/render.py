"""field -> pictures: the held-out views that are judged, a contact sheet and turntables for people."""

from __future__ import annotations

import io

import numpy as np

from dreamfields_core.rendering.images import on_shade, on_white
from dreamfields_core.rendering.pictures import BACKDROP, contact_sheet, depth_shades, picture, png, transmittance_shades
from dreamfields_core.scene.cameras import Pose, poses_at
from dreamfields_core.types import Rendering
from tasks.film import full_turn, keep_films
from tasks.finished_field import unpack_field, view_by
from tasks.step import Made, Work


def render(work: Work) -> Made:
    """Every picture of the finished field; those for people, not for the judge, with half the samples."""
    look, dream = work.config.evaluate, unpack_field(work.read("field"))
    closely, quickly = (view_by(dream, samples=samples) for samples in (look.samples, max(1, look.samples // 2)))

    def around(azimuths: tuple[float, ...]) -> Pose:
        return poses_at(azimuths, look.elevation, radius=look.radius, focal=look.focal)

    judged, shown = closely(around(look.azimuths), work.number("size")), quickly(around(look.azimuths), look.picture_size)
    turning = quickly(around(full_turn(look.turntable_frames)), look.picture_size)
    return Made(
        (
            work.keep("views.npz", _views(judged, np.asarray(dream.origin)), "application/x-npz"),
            work.keep("contact_sheet.png", png(contact_sheet(shown, work.text("caption"))), "image/png"),
            *(ref for name, frames in _turntables(turning).items() for ref in keep_films(work, name, frames)),
        ),
        {"opacity": float(1 - shown.transmittance.mean())},
    )


def _turntables(turning: Rendering) -> dict[str, list[np.ndarray]]:
    """One rendering gives all three: colour, depth and transmittance."""
    shades = {
        "turntable": on_shade(turning, BACKDROP),
        "turntable_depth": depth_shades(turning),
        "turntable_transmittance": transmittance_shades(turning),
    }
    return {name: list(picture(images)) for name, images in shades.items()}


def _views(judged: Rendering, origin: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, views=on_white(judged).astype(np.float32), origin=origin)
    return file.getvalue()

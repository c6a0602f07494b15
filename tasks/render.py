"""field -> pictures: the held-out views that are judged, a contact sheet and a turntable for people."""

from __future__ import annotations

import io

import numpy as np

from dreamfields_core.rendering.images import on_shade, on_white
from dreamfields_core.rendering.pictures import BACKDROP, contact_sheet, picture, png, webp_animation
from dreamfields_core.scene.cameras import Pose, poses_at
from dreamfields_core.types import Rendering
from tasks.film import mp4
from tasks.finished_field import unpack_field, view_by
from tasks.step import Made, Work


def render(work: Work) -> Made:
    """Every picture of the finished field; those for people, not for the judge, with half the samples."""
    look, dream = work.config.evaluate, unpack_field(work.read("field"))
    closely, quickly = (view_by(dream, samples=samples) for samples in (look.samples, max(1, look.samples // 2)))

    def around(azimuths: tuple[float, ...]) -> Pose:
        return poses_at(azimuths, look.elevation, radius=look.radius, focal=look.focal)

    judged, shown = closely(around(look.azimuths), work.number("size")), quickly(around(look.azimuths), look.picture_size)
    turn = tuple(360.0 * frame / look.turntable_frames for frame in range(look.turntable_frames))
    frames = list(picture(on_shade(quickly(around(turn), look.picture_size), BACKDROP)))
    return Made(
        (
            work.keep("views.npz", _views(judged, np.asarray(dream.origin)), "application/x-npz"),
            work.keep("contact_sheet.png", png(contact_sheet(shown, work.text("caption"))), "image/png"),
            work.keep("turntable.mp4", mp4(frames), "video/mp4"),
            work.keep("turntable.webp", webp_animation(frames), "image/webp"),
        ),
        {"opacity": float(1 - shown.transmittance.mean())},
    )


def _views(judged: Rendering, origin: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, views=on_white(judged).astype(np.float32), origin=origin)
    return file.getvalue()

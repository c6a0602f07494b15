"""Renderings as pictures for people: 8-bit colour, depth and transmittance, a contact sheet with its caption, WebP bytes.

Symbols: V views, H height, W width. Pictures are uint8 [H, W, 3].
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dreamfields_core.rendering.images import on_shade
from dreamfields_core.types import Rendering

INK = (24, 24, 27)
PAPER = (255, 255, 255)

BACKDROP = 0.8
"""Gray behind what people are shown; white things would vanish on white."""


def picture(image: np.ndarray) -> np.ndarray:
    """Colour in [0, 1], [..., H, W, 3], to the nearest of 256 levels; NaN becomes black."""
    return np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)


def depth_shades(views: Rendering) -> np.ndarray:
    """Near is bright, far is dark, nothing is white; one scale for all views, [V, H, W, 3] in [0, 1]."""
    depth, opacity = np.asarray(views.depth), 1.0 - np.asarray(views.transmittance)
    solid = opacity > 0.5
    near, far = (depth[solid].min(), depth[solid].max()) if solid.any() else (0.0, 1.0)
    shade = 0.9 - 0.8 * np.clip((depth - near) / max(far - near, 1e-6), 0.0, 1.0)
    return _grey(opacity * shade + (1.0 - opacity))


def transmittance_shades(views: Rendering) -> np.ndarray:
    """White is where the background shows, [V, H, W, 3] in [0, 1]."""
    return _grey(np.asarray(views.transmittance))


def contact_sheet(views: Rendering, caption: str) -> np.ndarray:
    """One column a view; rows of colour, depth and transmittance; the caption above."""
    rows = [picture(image) for image in (on_shade(views, BACKDROP), depth_shades(views), transmittance_shades(views))]
    grid = np.concatenate([np.concatenate(list(row), axis=1) for row in rows], axis=0)
    title = _title(caption, width=grid.shape[1])
    return np.concatenate([title, grid], axis=0)


def webp(image: np.ndarray) -> bytes:
    """A picture as WebP, a tenth of the size of PNG."""
    return _encode(Image.fromarray(image), "WEBP", quality=85, method=4)


def webp_animation(frames: Sequence[np.ndarray], *, seconds_per_frame: float = 1 / 12) -> bytes:
    """Frames as an endless WebP loop."""
    first, *rest = [Image.fromarray(frame) for frame in frames]
    return _encode(first, "WEBP", save_all=True, append_images=rest, duration=round(1000 * seconds_per_frame), loop=0, quality=80, method=2)


def thumbnail(image: np.ndarray, *, width: int) -> np.ndarray:
    """The picture no wider than asked, its proportions kept."""
    if image.shape[1] <= width:
        return image
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.LANCZOS))


def _grey(values: np.ndarray) -> np.ndarray:
    return np.repeat(values[..., None], 3, axis=-1)


def _title(text: str, *, width: int) -> np.ndarray:
    size = 18
    font = ImageFont.load_default(size)
    margin = 10
    while len(text) > 1 and font.getlength(text) > width - 2 * margin:
        text = text[:-2].rstrip() + "…"
    strip = Image.new("RGB", (width, size + 2 * margin), PAPER)
    ImageDraw.Draw(strip).text((margin, margin - 2), text, fill=INK, font=font)
    return np.asarray(strip)


def _encode(image: Image.Image, kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, format=kind, **options)
    return buffer.getvalue()

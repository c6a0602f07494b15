"""Stills of turntables, and many of them as one picture. Pictures are uint8 [H, W, 3]."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image

PAPER = 255


def still(animation: bytes) -> np.ndarray:
    """The first frame of an animated WebP. Raises: OSError where it is none."""
    with Image.open(io.BytesIO(animation), formats=["WEBP"]) as film:
        return np.asarray(film.convert("RGB"))


def montage(pictures: Sequence[np.ndarray], *, columns: int, side: int, gap: int = 4) -> np.ndarray:
    """Squares of `side` pixels, row by row, on white; at least one picture."""
    rows = -(-len(pictures) // columns)
    columns = min(columns, len(pictures))
    sheet = np.full((rows * (side + gap) - gap, columns * (side + gap) - gap, 3), PAPER, np.uint8)
    for place, one in enumerate(pictures):
        top, left = (side + gap) * (place // columns), (side + gap) * (place % columns)
        sheet[top : top + side, left : left + side] = np.asarray(Image.fromarray(one).resize((side, side), Image.Resampling.LANCZOS))
    return sheet

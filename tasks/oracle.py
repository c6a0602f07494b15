"""true pictures -> score: how a judge does where nothing had to be dreamed, the ceiling of every table (paper section 5.1, table 1)."""

from __future__ import annotations

import io
from dataclasses import asdict

import numpy as np
from PIL import Image

from dreamfields_core.config import EvaluateConfig
from dreamfields_core.judging.retrieval import retrieve
from dreamfields_core.rendering.pictures import webp
from dreamfields_core.teaching.pictures import Camera, render_description
from tasks.caption_sets import understood
from tasks.encoders import load_encoder
from tasks.pools import caption_pools, read_pool
from tasks.step import Made, Work


def oracle(work: Work) -> Made:
    """The judge's retrieval from a picture that came in, or, of a caption of the embedded language, from true views of what it says."""
    look, caption = work.config.evaluate, work.text("caption")
    judge = load_encoder(look.judge)
    seen = given(work.read("picture")) if "picture" in work.inputs else rendered(caption, look, size=judge.image_size)
    among = read_pool(work.read("pool")) if "pool" in work.inputs else []
    pools = caption_pools(caption, look.pool, among)
    said = {name: asdict(retrieve(judge, seen, pool[0], pool)) for name, pool in pools.items()}
    return Made((work.keep("poster.webp", webp((255 * seen[0] + 0.5).astype(np.uint8)), "image/webp"),), {"field": said})


def given(data: bytes) -> np.ndarray:
    """The middle square of a picture file, [1, side, side, 3] in [0, 1]."""
    with Image.open(io.BytesIO(data)) as picture:
        pixels = np.asarray(picture.convert("RGB"), np.float32) / 255
    side = min(pixels.shape[:2])
    top, left = ((length - side) // 2 for length in pixels.shape[:2])
    return pixels[None, top : top + side, left : left + side]


def rendered(caption: str, look: EvaluateConfig, *, size: int) -> np.ndarray:
    """True pictures of a caption of the embedded language from the held-out cameras, on white, [V, size, size, 3] in [0, 1]."""
    description = understood(caption)
    assert description is not None, f"asked only of captions that the language holds, got {caption!r}"
    cameras = [Camera(np.deg2rad(azimuth), np.deg2rad(look.elevation), look.radius, look.focal) for azimuth in look.azimuths]
    seen = render_description(description, cameras, size=size).astype(np.float32) / 255
    return seen[..., :3] + (1 - seen[..., 3:])

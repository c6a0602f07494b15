"""Frames as an MP4 that browsers, players and slides take."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import imageio_ffmpeg
import numpy as np

FRAMES_PER_SECOND = 12


class FilmError(RuntimeError):
    """The encoder failed; the text has its last words."""


def mp4(frames: Sequence[np.ndarray]) -> bytes:
    """H.264 with 4:2:0 colour; sides are cropped to even numbers. The same frames give the same bytes.

    frames: uint8 [H, W, 3] each, of one size. Raises: FilmError.
    """
    height, width = (side // 2 * 2 for side in frames[0].shape[:2])
    raw = b"".join(np.ascontiguousarray(frame[:height, :width]).tobytes() for frame in frames)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        done = subprocess.run([*_command(width, height), str(path)], input=raw, capture_output=True)
        if done.returncode != 0:
            raise FilmError(f'expected ffmpeg to write a film, got "{done.stderr.decode(errors="replace").strip()[-300:]}": see its build')
        return path.read_bytes()


def _command(width: int, height: int) -> list[str]:
    """One thread, since its output does not depend on how many there are; no dates and versions in the file."""
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(FRAMES_PER_SECOND), "-i", "-"]
    target = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", "-preset", "fast", "-threads", "1", "-movflags", "+faststart"]
    return [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *source, *target, "-fflags", "+bitexact", "-flags:v", "+bitexact"]

"""Objects that turn: the views all around, of a field or of its mesh, and films that browsers, players and slides take."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import imageio_ffmpeg
import jax
import numpy as np

from dreamfields_core.config import EvaluateConfig
from dreamfields_core.meshing import render_mesh
from dreamfields_core.rendering.pictures import BACKDROP, picture, webp_animation
from dreamfields_core.scene.cameras import camera_rays, poses_at
from dreamfields_core.types import Array, Mesh
from storage.artifacts import ArtifactRef
from tasks.step import Work

FRAMES_PER_SECOND = 12
FINER = 2
"""Rays a pixel along each side of a mesh's pictures: its edges are hard, and would be stairs."""


class FilmError(RuntimeError):
    """The encoder failed; the text has its last words."""


def full_turn(frames: int) -> tuple[float, ...]:
    """Azimuths, degrees."""
    return tuple(360.0 * frame / frames for frame in range(frames))


def mesh_turntable(mesh: Mesh, origin: Array, look: EvaluateConfig) -> list[np.ndarray]:
    """Frames uint8 [H, W, 3] of the mesh in its own colours, from the same cameras as the field's.

    origin: [3] of the scene.
    """
    frames = []
    for azimuth in full_turn(look.turntable_frames):
        pose = poses_at((azimuth,), look.elevation, radius=look.radius, focal=look.focal)
        rays = jax.device_get(camera_rays(pose, origin, size=FINER * look.picture_size))
        seen = render_mesh(mesh, rays.origins[0], rays.directions[0])
        finely = np.where(seen.hit[..., None], seen.color, BACKDROP)
        frames.append(picture(finely.reshape(look.picture_size, FINER, look.picture_size, FINER, 3).mean(axis=(1, 3))))
    return frames


def keep_films(work: Work, name: str, frames: Sequence[np.ndarray]) -> tuple[ArtifactRef, ArtifactRef]:
    """The same film as name.mp4 and name.webp. Raises: FilmError, StorageError."""
    return (
        work.keep(f"{name}.mp4", mp4(frames), "video/mp4"),
        work.keep(f"{name}.webp", webp_animation(frames), "image/webp"),
    )


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

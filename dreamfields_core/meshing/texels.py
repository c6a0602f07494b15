"""Textures, looked up and checked. Pixels are uint8 [S, S, 3], row 0 at the top; u runs right, v runs up."""

from __future__ import annotations

import numpy as np

from dreamfields_core.meshing.errors import BadMesh
from dreamfields_core.types import Mesh


def texel(pixels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Display colours [N, 3] in [0, 1] at uv [N, 2]: between the four nearest pixel centres, clamped at the edges."""
    height, width = pixels.shape[:2]
    across = np.clip(uv[:, 0] * width - 0.5, 0, width - 1)
    down = np.clip((1 - uv[:, 1]) * height - 0.5, 0, height - 1)
    left, top = np.floor(across).astype(int), np.floor(down).astype(int)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    s, t = (across - left)[:, None], (down - top)[:, None]
    upper = (1 - s) * pixels[top, left] + s * pixels[top, right]
    lower = (1 - s) * pixels[bottom, left] + s * pixels[bottom, right]
    return np.asarray(((1 - t) * upper + t * lower) / 255)


def vertex_colors(mesh: Mesh) -> np.ndarray | None:
    """[V, 3] display colours: the mesh's own, else its texture's where each vertex lies on it, else None."""
    if mesh.colors is not None or mesh.texture is None:
        return mesh.colors
    check_texture(mesh)
    return texel(mesh.texture.color, np.asarray(mesh.uv))


def check_texture(mesh: Mesh) -> None:
    """Raises BadMesh for a texture of another kind, or one that the mesh does not point into."""
    if mesh.texture is None:
        return
    if mesh.uv is None or mesh.uv.shape != (len(mesh.vertices), 2) or not np.isfinite(mesh.uv).all():
        raise BadMesh("expected finite uv [V, 2] beside the texture, got none that fit: unwrap the mesh again")
    for pixels in (mesh.texture.color, mesh.texture.normal_map):
        if pixels is not None and (pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 3):
            raise BadMesh(f"expected a texture uint8 [S, S, 3], got {pixels.dtype} {list(pixels.shape)}: bake it again")

"""How faithful a mesh is to its field: both seen by the same cameras, which had no say in making the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dreamfields_core.meshing.level import Views
from dreamfields_core.meshing.raycast import MeshRendering, render_mesh
from dreamfields_core.types import Mesh


@dataclass(frozen=True)
class Seen(Views):
    """What some cameras saw of a field. color: [V, ..., 3] premultiplied. depth: [V, ...] world units along the ray."""

    color: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True)
class Fidelity:
    """silhouette: intersection over union of where the mesh is and where the field is opaque, mean over the views, in [0, 1].
    silhouettes: the same for each view. image: peak signal-to-noise ratio in dB, on white, of the pixels in the union; a soft edge counts.
    depth: mean distance between the two surfaces along rays that meet both, world units.
    None where there is nothing to compare.
    """

    silhouette: float | None
    silhouettes: tuple[float | None, ...]
    image: float | None
    depth: float | None


def fidelity(mesh: Mesh, seen: Seen) -> Fidelity:
    """The mesh, unlit, against what the cameras saw of its field."""
    mine = render_mesh(mesh, seen.origins, seen.directions)
    opaque = np.asarray(seen.opacity) > 0.5
    views = [intersection_over_union(hit, mask) for hit, mask in zip(mine.hit, opaque, strict=True)]
    told = [value for value in views if value is not None]
    both = mine.hit & opaque
    return Fidelity(
        silhouette=float(np.mean(told)) if told else None,
        silhouettes=tuple(views),
        image=_image_error(mine, seen, mine.hit | opaque),
        depth=float(np.abs(mine.depth - seen.depth)[both].mean()) if both.any() else None,
    )


def intersection_over_union(first: np.ndarray, second: np.ndarray) -> float | None:
    """|A AND B| / |A OR B| of two masks; None where both are empty."""
    union = int((first | second).sum())
    return int((first & second).sum()) / union if union else None


def psnr(first: np.ndarray, second: np.ndarray) -> float:
    """-10 log10 of the mean squared difference, in dB; values in [0, 1]. No difference at all counts as half an 8-bit level."""
    return float(-10 * np.log10(max(float(np.mean(np.square(first - second))), (0.5 / 255) ** 2)))


def _image_error(mine: MeshRendering, seen: Seen, union: np.ndarray) -> float | None:
    if not union.any():
        return None
    on_white = mine.color + ~mine.hit[..., None], seen.color + (1 - np.asarray(seen.opacity))[..., None]
    return psnr(on_white[0][union], on_white[1][union])

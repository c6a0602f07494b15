"""A mesh laid flat: cut into charts by xatlas, in a process of its own (see `unwrap_worker`). u runs right, v runs up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dreamfields_core.meshing.errors import BadBudget, MeshCleaningFailed
from dreamfields_core.meshing.native import ask_native, worker
from dreamfields_core.types import Mesh

WORKER = worker("unwrap_worker.py")
SIZES = (256, 4096)
GUTTER = 10
"""Texels between charts on a sheet of 1024: two texels of the mip level 4 times smaller, for the packer makes its sheet a third larger."""


def unwrap(mesh: Mesh, size: int, *, timeout: float = 1800.0, command: Sequence[str] = WORKER) -> tuple[Mesh, np.ndarray]:
    """(the same surface with uv [W, 2] in [0, 1] for a square texture of `size` texels, source [W]: the vertex that each one was).

    Vertices on seams are doubled; faces keep their order.

    Raises:
      BadBudget: the size is not one of 256..4096.
      MeshCleaningFailed: see `native`.
    """
    check_texture_size(size)
    question = {
        "vertices": np.asarray(mesh.vertices, np.float32),
        "faces": np.asarray(mesh.faces, np.int32),
        "size": np.asarray(size),
        "gutter": np.asarray(round(GUTTER * size / 1024)),
    }
    answer = ask_native(command, question, timeout=timeout, way_out="lower mesh.faces, or set mesh.texture to null")
    if answer.keys() != {"source", "faces", "uv"} or len(answer["faces"]) != len(mesh.faces) or not np.isfinite(answer["uv"]).all():
        raise MeshCleaningFailed("expected a flat mesh from the chart maker, got one that is not whole: set mesh.texture to null")
    source = answer["source"]
    flat = replace(
        mesh,
        vertices=mesh.vertices[source],
        faces=answer["faces"],
        colors=None if mesh.colors is None else mesh.colors[source],
        normals=None if mesh.normals is None else mesh.normals[source],
        uv=np.clip(answer["uv"], 0, 1),
    )
    return flat, source


def check_texture_size(size: int) -> None:
    """Raises BadBudget outside SIZES."""
    if isinstance(size, bool) or not isinstance(size, (int, np.integer)) or not SIZES[0] <= size <= SIZES[1]:
        raise BadBudget(f"expected a texture of {SIZES[0]} to {SIZES[1]} texels a side, got {size!r}: set mesh.texture to 1024, or to null")

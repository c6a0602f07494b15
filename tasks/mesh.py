"""field -> mesh: a clean, light, coloured surface whose level agrees with what the renderer saw."""

from __future__ import annotations

from dataclasses import asdict

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.config import EvaluateConfig
from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.meshing import Views, extract_mesh, to_glb
from dreamfields_core.scene.cameras import camera_rays, poses_at
from tasks.finished_field import FinishedField, unpack_field, view_by
from tasks.step import Made, Work

AZIMUTHS = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
ELEVATION = 30.0
SIZE = 96
"""Of the views whose silhouettes choose the level; pixels."""


def mesh(work: Work) -> Made:
    """The surface as GLB, and its counts. Raises: MeshError."""
    dream, wanted = unpack_field(work.read("field")), work.config.mesh
    prepared = jax.jit(dream.field.prepare)(dream.params)
    ask = jax.jit(lambda points: dream.field.apply(prepared, points_as_gaussians(points)))
    asset = extract_mesh(
        lambda points: np.asarray(ask(jnp.asarray(points, jnp.float32))[0]),
        lambda points: np.asarray(ask(jnp.asarray(points, jnp.float32))[1]),
        level=None if wanted.level is None else dream.field.raw(wanted.level),
        views=_silhouettes(dream, work.config.evaluate) if wanted.level is None else None,
        origin=np.asarray(dream.origin),
        bound=dream.config.scene.bound,
        resolution=wanted.resolution,
        faces=wanted.faces,
    )
    provenance = {"generator": "dreamfields", "caption": work.text("caption"), "field": work.digest("field"), "step": work.key}
    return Made(
        (work.keep("mesh.glb", to_glb(asset.mesh, provenance), "model/gltf-binary"),),
        {
            "level": asset.level,
            "agreement": asset.agreement,
            "mesh": asdict(asset.report),
            "extracted": asdict(asset.extracted),
            "points_asked": asset.asked,
        },
    )


def _silhouettes(dream: FinishedField, look: EvaluateConfig) -> Views:
    """What the renderer sees as opaque, from all around."""
    poses = poses_at(AZIMUTHS, ELEVATION, radius=look.radius, focal=look.focal)
    seen = view_by(dream, samples=look.samples)(poses, SIZE)
    rays = jax.device_get(camera_rays(poses, dream.origin, size=SIZE))
    return Views(rays.origins, rays.directions, 1.0 - np.asarray(seen.transmittance))

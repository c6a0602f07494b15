"""field -> mesh: a clean, light, textured surface whose level agrees with what the renderer saw, and how faithful it is."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.config import EvaluateConfig
from dreamfields_core.fields.contract import points_as_gaussians
from dreamfields_core.meshing import Asset, Look, Seen, extract_mesh, fidelity, from_glb, to_glb
from dreamfields_core.scene.cameras import Pose, camera_rays, poses_at
from tasks.film import keep_films, mesh_turntable
from tasks.finished_field import FinishedField, unpack_field, view_by
from tasks.provenance import provenance
from tasks.step import Made, Work

AZIMUTHS = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
RINGS = {-15.0: 0.0, 20.0: 20.0, 65.0: 40.0}
"""Elevation -> how far the azimuths are turned, degrees: from all around, from below too, and none of the views that are scored."""

SIZE = 64
"""Of the views whose silhouettes choose the level; pixels."""

HELD_OUT_SIZE = 160
"""Of the views that the mesh is compared with its field in; pixels."""


def mesh(work: Work) -> Made:
    """The surface as GLB, lighter ones beside it, their counts, and the distance from the field. Raises: MeshError."""
    dream, look = unpack_field(work.read("field")), work.config.evaluate
    asset = _extract(work, dream)
    origin = provenance(work)
    files = {file_name(k): to_glb(made, origin) for k, made in enumerate((asset.mesh, *asset.details))}
    held_out = poses_at(look.azimuths, look.elevation, radius=look.radius, focal=look.focal)
    seen = _seen(dream, look, held_out, HELD_OUT_SIZE)
    # What is judged is what the files hold.
    faithful = [asdict(fidelity(from_glb(data), seen)) for data in files.values()]
    film = keep_films(work, "mesh_turntable", mesh_turntable(from_glb(files["mesh.glb"]), dream.origin, look))
    return Made((*(work.keep(name, data, "model/gltf-binary") for name, data in files.items()), *film), _values(asset, faithful))


def file_name(level: int) -> str:
    """mesh.glb, and mesh_lod1.glb, mesh_lod2.glb ... for the lighter ones."""
    return f"mesh_lod{level}.glb" if level else "mesh.glb"


def _values(asset: Asset, faithful: list[dict[str, Any]]) -> dict[str, Any]:
    main, *lighter = faithful
    return {
        "level": asset.level,
        "agreement": asset.agreement,
        "mesh": asdict(asset.report),
        "fidelity": main,
        "details": [{"mesh": asdict(counts), "fidelity": told} for counts, told in zip(asset.detail_reports, lighter, strict=True)],
        "extracted": asdict(asset.extracted),
        "points_asked": asset.asked,
    }


def _extract(work: Work, dream: FinishedField) -> Asset:
    wanted = work.config.mesh
    prepared = jax.jit(dream.field.prepare)(dream.params)
    # Two programs: what one of them does not give it need not compute.
    raw = jax.jit(lambda points: dream.field.apply(prepared, points_as_gaussians(points))[0])
    color = jax.jit(lambda points: dream.field.apply(prepared, points_as_gaussians(points))[1])
    return extract_mesh(
        lambda points: np.asarray(raw(jnp.asarray(points, jnp.float32))),
        lambda points: np.asarray(color(jnp.asarray(points, jnp.float32))),
        level=None if wanted.level is None else dream.field.raw(wanted.level),
        views=_seen(dream, work.config.evaluate, _all_around(work.config.evaluate), SIZE) if wanted.level is None else None,
        origin=np.asarray(dream.origin),
        bound=dream.config.scene.bound,
        resolution=wanted.resolution,
        faces=wanted.faces,
        details=wanted.details,
        error=wanted.error,
        smooth=wanted.smooth,
        look=Look(
            texture=wanted.texture,
            normal_map=wanted.normal_map,
            samples=wanted.color_samples,
            density=lambda values: np.asarray(dream.field.density(jnp.asarray(values))),
        ),
        progress=lambda points: work.place.report({"event": "asked", "points": points}),
    )


def _all_around(look: EvaluateConfig) -> Pose:
    rings = [
        poses_at([azimuth + turn for azimuth in AZIMUTHS], elevation, radius=look.radius, focal=look.focal)
        for elevation, turn in RINGS.items()
    ]
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *rings)  # type: ignore[no-any-return]


def _seen(dream: FinishedField, look: EvaluateConfig, poses: Pose, size: int) -> Seen:
    """What the renderer sees from there."""
    views = view_by(dream, samples=look.samples)(poses, size)
    rays = jax.device_get(camera_rays(poses, dream.origin, size=size))
    opacity = 1.0 - np.asarray(views.transmittance)
    return Seen(rays.origins, rays.directions, opacity, np.asarray(views.color), np.asarray(views.depth))

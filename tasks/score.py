"""pictures, mesh -> score: does the judge, who did not guide, pick the caption out of many (paper section 5.1)?"""

from __future__ import annotations

import io
from dataclasses import asdict

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.judging.retrieval import retrieve
from dreamfields_core.meshing import from_glb, render_mesh
from dreamfields_core.scene.cameras import camera_rays, poses_at
from tasks.encoders import load_encoder
from tasks.pools import caption_pools, read_pool
from tasks.step import Made, Work


def score(work: Work) -> Made:
    """The judge's retrieval, from pictures of the field and of the mesh, in each pool of captions."""
    look, caption = work.config.evaluate, work.text("caption")
    among = read_pool(work.read("pool")) if "pool" in work.inputs else []
    judge, pools = load_encoder(look.judge), caption_pools(caption, look.pool, among)
    with np.load(io.BytesIO(work.read("views")), allow_pickle=False) as seen:
        views, origin = seen["views"], seen["origin"]
    pictures = {"field": views, "mesh": _mesh_views(work, origin, size=views.shape[1])}
    return Made(
        values={
            what: {name: asdict(retrieve(judge, images, pool[0], pool)) for name, pool in pools.items()}
            for what, images in pictures.items()
        }
    )


def _mesh_views(work: Work, origin: np.ndarray, *, size: int) -> np.ndarray:
    """The mesh from the held-out cameras, on white, [V, size, size, 3]."""
    look = work.config.evaluate
    poses = poses_at(look.azimuths, look.elevation, radius=look.radius, focal=look.focal)
    rays = jax.device_get(camera_rays(poses, jnp.asarray(origin), size=size))
    seen = render_mesh(from_glb(work.read("mesh")), rays.origins, rays.directions)
    return np.where(seen.hit[..., None], seen.color, 1.0)

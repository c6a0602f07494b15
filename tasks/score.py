"""pictures -> score: does the judge, who did not guide, pick the caption out of many (paper section 5.1)?"""

from __future__ import annotations

import io
from dataclasses import asdict
from typing import Any

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
    """The judge's retrieval from the held-out views of the field, in each pool of captions, and its ranks on the way."""
    seen = _arrays(work, "views")
    return Made(values={"field": _judged(work, seen["views"])} | ({"learning": _learning(work)} if "glimpses" in work.inputs else {}))


def score_mesh(work: Work) -> Made:
    """The same from the mesh, seen by the cameras and in the size of the field's views."""
    seen = _arrays(work, "views")
    return Made(values={"mesh": _judged(work, _mesh_views(work, seen["origin"], size=seen["views"].shape[1]))})


def _judged(work: Work, pictures: np.ndarray) -> dict[str, Any]:
    """By pool. pictures: [V, H, W, 3] in [0, 1]."""
    judge, pools = load_encoder(work.config.evaluate.judge), _pools(work)
    return {name: asdict(retrieve(judge, pictures, pool[0], pool)) for name, pool in pools.items()}


def _learning(work: Work) -> dict[str, list[int]]:
    """Steps, and at each the rank of the caption in the first pool: a guide that goes on improving while it falls is over-fitted."""
    seen, pool = _arrays(work, "glimpses"), next(iter(_pools(work).values()))
    said = retrieve(load_encoder(work.config.evaluate.judge), seen["pictures"].astype(np.float32) / 255, pool[0], pool)
    return {"steps": [int(step) for step in seen["steps"]], "ranks": list(said.ranks)}


def _pools(work: Work) -> dict[str, list[str]]:
    among = read_pool(work.read("pool")) if "pool" in work.inputs else []
    return caption_pools(work.text("caption"), work.config.evaluate.pool, among)


def _mesh_views(work: Work, origin: np.ndarray, *, size: int) -> np.ndarray:
    """The mesh from the held-out cameras, on white, [V, size, size, 3]."""
    look = work.config.evaluate
    poses = poses_at(look.azimuths, look.elevation, radius=look.radius, focal=look.focal)
    rays = jax.device_get(camera_rays(poses, jnp.asarray(origin), size=size))
    seen = render_mesh(from_glb(work.read("mesh")), rays.origins, rays.directions)
    return np.where(seen.hit[..., None], seen.color, 1.0)


def _arrays(work: Work, name: str) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(work.read(name)), allow_pickle=False) as file:
        return dict(file)

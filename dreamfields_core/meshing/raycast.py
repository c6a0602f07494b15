"""Meshes seen by a camera: rays against triangles, by Embree. For silhouettes, previews and the fidelity of a mesh to its field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from dreamfields_core.types import Mesh


@dataclass(frozen=True)
class Hits:
    """Where rays first meet a mesh.

    hit: [...] bool. depth: [...] float32, distance in lengths of the direction, 0 where missed.
    face: [...] int32, -1 where missed. weights: [..., 3] barycentric weights of the face's corners.
    normal: [..., 3] unit normal of the face, 0 where missed.
    """

    hit: np.ndarray
    depth: np.ndarray
    face: np.ndarray
    weights: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True)
class MeshRendering:
    """color: [..., 3] in [0, 1], premultiplied: 0 where missed. hit: [...] bool. depth: [...], 0 where missed."""

    color: np.ndarray
    hit: np.ndarray
    depth: np.ndarray


def cast(mesh: Mesh, origins: np.ndarray, directions: np.ndarray) -> Hits:
    """First hits of rays origins [..., 3], directions [..., 3] (they broadcast)."""
    origins, directions = np.broadcast_arrays(np.asarray(origins, np.float32), np.asarray(directions, np.float32))
    shape = origins.shape[:-1]
    scene = EmbreeScene(robust=True)  # watertight at shared edges: no pinholes in silhouettes
    TriangleMesh(scene, np.ascontiguousarray(mesh.vertices, np.float32), np.ascontiguousarray(mesh.faces, np.int32))
    found = scene.run(
        np.ascontiguousarray(origins.reshape(-1, 3)), np.ascontiguousarray(directions.reshape(-1, 3)), query="INTERSECT", output=True
    )
    hit = found["primID"] >= 0
    u, v = np.where(hit, found["u"], 0), np.where(hit, found["v"], 0)
    a, b, c = np.moveaxis(np.asarray(mesh.vertices, np.float64)[mesh.faces[np.where(hit, found["primID"], 0)]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal = np.where(hit[:, None], normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30), 0)
    return Hits(
        hit=hit.reshape(shape),
        depth=np.where(hit, found["tfar"], 0).astype(np.float32).reshape(shape),
        face=found["primID"].reshape(shape),
        weights=np.stack([1 - u - v, u, v], axis=-1).reshape(*shape, 3),
        normal=normal.astype(np.float32).reshape(*shape, 3),
    )


def silhouette(mesh: Mesh, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """[...] bool: which rays [..., 3] meet the mesh."""
    return cast(mesh, origins, directions).hit


def render_mesh(mesh: Mesh, origins: np.ndarray, directions: np.ndarray, *, light: np.ndarray | None = None) -> MeshRendering:
    """The mesh's own vertex colours (grey when it has none) along rays [..., 3], unlit as the field is.

    light: [3] towards a lamp; given, faces are shaded by it, which shows the shape.
    """
    hits = cast(mesh, origins, directions)
    colors = np.full((len(mesh.vertices), 3), 0.75) if mesh.colors is None else mesh.colors
    color = np.einsum("...k,...kc->...c", hits.weights, colors[mesh.faces[np.maximum(hits.face, 0)]])
    if light is not None:
        lamp = np.asarray(light, np.float64) / np.linalg.norm(light)
        color = color * (0.6 + 0.4 * hits.normal @ lamp)[..., None]  # wrapped around: the far side shows its shape too
    return MeshRendering(color=np.where(hits.hit[..., None], color, 0).astype(np.float32), hit=hits.hit, depth=hits.depth)

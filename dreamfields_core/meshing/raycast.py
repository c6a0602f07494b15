"""Meshes seen by a camera: rays against triangles, by Embree. For silhouettes, previews and the fidelity of a mesh to its field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from dreamfields_core.meshing.texels import texel
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


def render_mesh(mesh: Mesh, origins: np.ndarray, directions: np.ndarray, *, light: np.ndarray | None = None) -> MeshRendering:
    """The mesh's own texture, else its vertex colours, else grey, along rays [..., 3], unlit as the field is.

    light: [3] towards a lamp; given, the surface is shaded by it, which shows the shape: by the mesh's own normals where it has some.
    """
    hits = cast(mesh, origins, directions)
    color = hit_colors(mesh, hits)
    if light is not None:
        lamp = np.asarray(light, np.float64) / np.linalg.norm(light)
        color = color * (0.6 + 0.4 * _shading_normals(mesh, hits) @ lamp)[..., None]  # wrapped around: the far side shows its shape too
    return MeshRendering(color=np.where(hits.hit[..., None], color, 0).astype(np.float32), hit=hits.hit, depth=hits.depth)


def hit_colors(mesh: Mesh, hits: Hits) -> np.ndarray:
    """[..., 3] display colours where rays meet the mesh; what stands where they miss means nothing."""
    corners = mesh.faces[np.maximum(hits.face, 0)]
    if mesh.texture is not None and mesh.uv is not None:
        uv = np.einsum("...k,...kc->...c", hits.weights, mesh.uv[corners])
        return texel(mesh.texture.color, uv.reshape(-1, 2)).reshape(*hits.hit.shape, 3)
    colors = np.full((len(mesh.vertices), 3), 0.75) if mesh.colors is None else mesh.colors
    return np.asarray(np.einsum("...k,...kc->...c", hits.weights, colors[corners]))


def _shading_normals(mesh: Mesh, hits: Hits) -> np.ndarray:
    """[..., 3] unit normals between those of the corners, or the faces' where there are none; 0 where missed."""
    if mesh.normals is None:
        return hits.normal
    smooth = np.einsum("...k,...kc->...c", hits.weights, mesh.normals[mesh.faces[np.maximum(hits.face, 0)]])
    return np.asarray(np.where(hits.hit[..., None], smooth / np.maximum(np.linalg.norm(smooth, axis=-1, keepdims=True), 1e-30), 0))

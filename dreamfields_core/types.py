"""The values that travel between the rooms of the core.

Conventions, stated once:

* World space is right-handed with Z up. The scene is a cube of half-side `bound` about an origin.
* Images are [..., height, width, channel], row 0 at the top, colour in [0, 1] as a display shows it (sRGB values; nothing is linearised).
* Colour is premultiplied by opacity unless a name says otherwise: what stands on a background is `color + transmittance * background`.
* Angles are degrees in configurations and radians in functions whose argument says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import flax.struct
import jax
import numpy as np

Array = jax.Array
Params = Any
"""A pytree of arrays, as `flax.nnx.split` gives it."""


@flax.struct.dataclass
class Rays:
    """Cone-shaped rays (mip-NeRF, section 3.1).

    origins: [..., 3] where each ray starts, world space.
    directions: [..., 3] unit vectors.
    radii: [..., 1] radius of the pixel's cone at distance 1.
    """

    origins: Array
    directions: Array
    radii: Array


@flax.struct.dataclass
class Gaussians:
    """Conical frustums approximated by Gaussians (mip-NeRF, equation 8), kept as two variances instead of a 3 x 3 matrix.

    means: [..., 3] positions, world space.
    directions: [..., 3] unit direction of the ray each one lies on.
    along: [...] variance along the ray.
    across: [...] variance perpendicular to the ray.
    """

    means: Array
    directions: Array
    along: Array
    across: Array


@flax.struct.dataclass
class Rendering:
    """What a camera sees of a field.

    color: [..., 3] premultiplied.
    transmittance: [...] share of the background that is seen, in [0, 1].
    depth: [...] expected distance along the ray, divided by opacity; 0 where nothing is hit.
    """

    color: Array
    transmittance: Array
    depth: Array


@dataclass(frozen=True)
class Encoder:
    """An image-text model whose two towers share one space of unit vectors (paper section 3.2).

    The weights are an argument, `params`, so that compiled programs do not hold them as constants.

    name: what the user calls it.
    digest: sha256 of the weights and of everything else that decides the embeddings.
    image_size: side of the square pictures it was trained on.
    dim: length of an embedding.
    params: the weights, a pytree.
    tokenize: captions -> integer tokens [batch, length].
    encode_text: (params, tokens [batch, length]) -> unit vectors [batch, dim].
    encode_image: (params, images [batch, height, width, 3] in [0, 1]) -> unit vectors [batch, dim];
        any size comes in (it is resized), differentiable in the images.
    unknown_words: caption -> the words that the model has never seen, () for models of open language.
    """

    name: str
    digest: str
    image_size: int
    dim: int
    params: Params = field(repr=False)
    tokenize: Callable[[Sequence[str]], np.ndarray] = field(repr=False)
    encode_text: Callable[[Params, Array], Array] = field(repr=False)
    encode_image: Callable[[Params, Array], Array] = field(repr=False)
    unknown_words: Callable[[str], tuple[str, ...]] = field(repr=False, default=lambda caption: ())


@dataclass(frozen=True)
class Texture:
    """Pictures that lie on a mesh, uint8 [size, size, 3], row 0 at the top.

    color: display colour (sRGB values). normal_map: tangent-space normals, 0.5 (n + 1), green up; None where none was baked.
    """

    color: np.ndarray
    normal_map: np.ndarray | None = None


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh, on the host.

    vertices: [V, 3] float32, world space, Z up.
    faces: [F, 3] int32, counter-clockwise seen from outside.
    colors: [V, 3] float32 in [0, 1], or None before they are asked of the field.
    normals: [V, 3] float32 unit vectors pointing out, or None.
    uv: [V, 2] float32 in [0, 1], u to the right and v up the texture, or None; seams double their vertices.
    texture: what `uv` points into, or None.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None = None
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None
    texture: Texture | None = None

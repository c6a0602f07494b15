"""Each kind of field written out in float64, one sample at a time, sharing no code with the fields themselves."""

from __future__ import annotations

import math

import numpy as np

from tests import reference


def nerf_mlp(params: dict, encoded: np.ndarray, depth: int) -> np.ndarray:
    """Raw density and colour [4] (NeRF appendix A): ReLU layers, the encoding again after the middle one."""
    hidden = encoded
    for index in range(depth):
        layer = params["layers"][index]
        hidden = np.maximum(hidden @ layer["kernel"] + layer["bias"], 0.0)
        if index == depth // 2:
            hidden = np.concatenate([encoded, hidden])
    out = hidden @ params["out"]["kernel"] + params["out"]["bias"]
    return np.concatenate([out[:1], reference.sigmoid(out[1:])])


def voxel_grid(params: dict, point: np.ndarray, bound: float) -> np.ndarray:
    """Raw density and colour [4]: eight corners."""
    out = reference.read_grid(params["grid"], point, bound)
    return np.concatenate([out[:1], reference.sigmoid(out[1:])])


def inverse_softplus(log_density: float) -> float:
    """log(e^x - 1) of a density x that is known by its logarithm; of a small one that logarithm itself, to first order."""
    density = math.exp(log_density)
    return math.log(math.expm1(density)) if log_density > -30 else log_density


def laplace(x: float, beta: float) -> float:
    """Psi_beta(x), the distribution function of Laplace's distribution (VolSDF equation 3)."""
    return 0.5 * math.exp(x / beta) if x <= 0 else 1.0 - 0.5 * math.exp(-x / beta)


def distance(network: dict, point: np.ndarray, matrix: np.ndarray, radius: float, *, integrated: bool) -> tuple[float, np.ndarray]:
    """The signed distance of a ball with a tenth of the network's output added, and colours [3]."""
    spread = matrix if integrated else 0.0 * matrix
    out = reference.residual_mlp(network, reference.encoding(network["frequencies"], point, spread))
    return math.sqrt(float(point @ point) + 1e-6) - radius + 0.1 * out[0], out[1:]


def signed_distance(params: dict, point: np.ndarray, matrix: np.ndarray, radius: float) -> np.ndarray:
    """Raw density and colour [4] (VolSDF equation 2 with alpha = 1 / beta)."""
    away, colors = distance(params["network"], point, matrix, radius, integrated=True)
    beta = 1e-3 + math.exp(float(params["log_beta"]))
    return np.array([inverse_softplus(math.log(laplace(-away, beta) / beta)), *colors])


def read_picture(picture: np.ndarray, across: np.ndarray, extent: float) -> np.ndarray:
    """Bilinear interpolation at one place [2], every pixel one by one."""
    cells = picture.shape[0] - 1
    place = [min(max((x / extent + 1.0) / 2.0 * cells, 0.0), float(cells)) for x in across]
    total = np.zeros(picture.shape[-1])
    for row in range(cells + 1):
        for column in range(cells + 1):
            total += max(0.0, 1.0 - abs(place[0] - row)) * max(0.0, 1.0 - abs(place[1] - column)) * picture[row, column]
    return total


def image_plane(params: dict, point: np.ndarray, config: object) -> np.ndarray:
    """Raw density and colour [4]: where the camera's ray through the point meets the sheet, and how deep in the sheet the point is."""
    azimuth, elevation = math.radians(config.azimuth), math.radians(config.elevation)
    toward = np.array([math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)])
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    eye = config.radius * toward
    height = float(point @ toward)
    meets = eye + (point - eye) * (config.radius / (config.radius - height))
    across = np.array([meets @ right, meets @ up])
    out = read_picture(params["picture"], across, config.extent)
    profile = -0.5 * (height / config.thickness) ** 2 - math.log(config.thickness * math.sqrt(2 * math.pi))
    lean = float((eye - meets) @ toward) / float(np.linalg.norm(eye - meets))
    beyond = max(float(np.abs(across).max()) / config.extent - 1.0, 0.0)
    depth = math.log(float(reference.softplus(out[:1])[0]))
    return np.array([inverse_softplus(depth + profile + math.log(lean) - 0.5 * (beyond / 0.01) ** 2), *reference.sigmoid(out[1:])])

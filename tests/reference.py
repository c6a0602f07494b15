"""Slow, obvious twins of the core's equations, in float64 with plain loops. They are the judge, so they share no code with it.

Symbols as in the papers: "paper" is Dream Fields, "mip-NeRF" is Barron et al. 2021, "NeRF" Mildenhall et al. 2020.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np


def look_at_rays(
    azimuth: float, elevation: float, radius: float, focal: float, origin: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, directions and radii [size, size, ...] of a look-at camera (paper section 4.4); angles in radians.

    The camera's matrix comes from cross products with the world's up, which is why it cannot look straight down.
    """
    place = np.array([math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)])
    position = origin + radius * place
    forward = (origin - position) / np.linalg.norm(origin - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    directions, radii = np.zeros((size, size, 3)), np.zeros((size, size, 1))
    for row in range(size):
        for column in range(size):
            x = ((column + 0.5) / size - 0.5) / focal
            y = -((row + 0.5) / size - 0.5) / focal
            toward = x * right + y * up + forward
            directions[row, column] = toward / np.linalg.norm(toward)
            # mip-NeRF section 3.1: the pixel's width in world space, scaled by 2 / sqrt(12); here at distance 1 along the ray.
            radii[row, column] = (1.0 / (size * focal)) * 2.0 / math.sqrt(12.0) / np.linalg.norm(toward)
    return np.broadcast_to(position, directions.shape), directions, radii


def ray_cube(start: np.ndarray, direction: np.ndarray, center: np.ndarray, bound: float) -> tuple[float, float]:
    """Where one ray enters and leaves a cube, (0, 0) if nowhere: the intersection of three slabs (paper section 4.6)."""
    near, far = 0.0, math.inf
    for axis in range(3):
        place, speed = float(start[axis]) - float(center[axis]), float(direction[axis])
        if speed == 0.0:
            if abs(place) > bound:
                return 0.0, 0.0
            continue
        crossings = sorted(((-bound - place) / speed, (bound - place) / speed))
        near, far = max(near, crossings[0]), min(far, crossings[1])
    return (near, far) if far > near else (0.0, 0.0)


def frustum(middle: float, half: float, radius: float) -> tuple[float, float, float]:
    """Mean distance, variance along and variance across of the points of a cone between two distances.

    The moments of mip-NeRF's appendix A, E[t^k] over a density that grows as t^2, in exact rational arithmetic: as they stand
    there they cancel to nothing in floating point, for which its equation 7 was made.
    """
    near, far = Fraction(middle) - Fraction(half), Fraction(middle) + Fraction(half)

    def moment(power: int) -> Fraction:
        return Fraction(3, power + 3) * (far ** (power + 3) - near ** (power + 3)) / (far**3 - near**3)

    # The disc at distance t has radius r t; the variance of a disc about one axis is a quarter of its radius squared.
    return float(moment(1)), float(moment(2) - moment(1) ** 2), float(Fraction(radius) ** 2 * moment(2) / 4)


def covariance(direction: np.ndarray, along: float, across: float) -> np.ndarray:
    """[3, 3], mip-NeRF equation 8."""
    outer = np.outer(direction, direction)
    return along * outer + across * (np.eye(3) - outer)


def encoding(frequencies: np.ndarray, mean: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The position and E[sin], E[cos] of every frequency over one Gaussian (mip-NeRF equation 14, paper section 3.1)."""
    sines, cosines = [], []
    for omega in frequencies:
        damping = math.exp(-0.5 * float(omega @ matrix @ omega))
        sines.append(damping * math.sin(float(omega @ mean)))
        cosines.append(damping * math.cos(float(omega @ mean)))
    return np.array([*mean, *sines, *cosines])


def swish(x: np.ndarray) -> np.ndarray:
    return x / (1.0 + np.exp(-x))


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-x))


def softplus(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0.0) + np.log1p(np.exp(-np.abs(x)))


def residual_mlp(params: dict, encoded: np.ndarray) -> np.ndarray:
    """Raw density and colour [4] of one encoded sample (paper section 4.7)."""

    def dense(layer: dict, x: np.ndarray) -> np.ndarray:
        return x @ layer["kernel"] + layer["bias"]

    hidden = swish(dense(params["enter"], encoded))
    for _, block in sorted(params["blocks"].items()):
        centered = hidden - hidden.mean()
        normal = centered / math.sqrt(float((centered**2).mean()) + 1e-6) * block["norm"]["scale"] + block["norm"]["bias"]
        hidden = hidden + dense(block["narrow"], swish(dense(block["widen"], normal)))
    out = dense(params["out"], swish(dense(params["leave"], hidden)))
    return np.concatenate([out[:1], sigmoid(out[1:])])


def read_grid(grid: np.ndarray, point: np.ndarray, bound: float) -> np.ndarray:
    """Trilinear interpolation at one point, eight corners one by one; outside the cube, the nearest place on its faces."""
    cells = grid.shape[0] - 1
    place = [min(max((float(x) / bound + 1.0) / 2.0 * cells, 0.0), float(cells)) for x in point]
    total = np.zeros(grid.shape[-1])
    for x in range(cells + 1):
        for y in range(cells + 1):
            for z in range(cells + 1):
                hats = [max(0.0, 1.0 - abs(there - here)) for there, here in zip(place, (x, y, z), strict=True)]
                total += math.prod(hats) * grid[x, y, z]
    return total


def resample(grid: np.ndarray, resolution: int) -> np.ndarray:
    """The same grid with other vertices: each new one reads the old grid where it stands."""
    out = np.zeros((resolution + 1,) * 3 + grid.shape[3:])
    for index in np.ndindex(*out.shape[:3]):
        out[index] = read_grid(grid, np.array(index) * 2.0 / resolution - 1.0, 1.0)
    return out


def total_variation(grid: np.ndarray) -> float:
    """Mean squared difference of neighbours, added over the three axes."""
    total = 0.0
    for axis in range(3):
        squares = []
        for index in np.ndindex(*grid.shape):
            if index[axis] + 1 < grid.shape[axis]:
                after = tuple(place + (number == axis) for number, place in enumerate(index))
                squares.append((grid[after] - grid[index]) ** 2)
        total += sum(squares) / len(squares)
    return total


def hybrid(params: dict, point: np.ndarray, config: object, bound: float) -> np.ndarray:
    """Raw density and colour [4] at one point: grids resampled to the finest and added, then the network (paper appendix D)."""
    grids, finest = params["grids"], max(config.resolutions)
    whole = sum(config.falloff**level * resample(grids[f"grid{size}"], finest) for level, size in enumerate(config.resolutions))
    features = read_grid(whole, point, bound)
    for index in range(len(params["layers"])):
        layer = params["layers"][f"layer{index}"]
        features = (swish(features) if index else features) @ layer["kernel"] + layer["bias"]
    bump = math.exp(-0.5 * float(point @ point) / config.blob_radius**2)
    return np.concatenate([features[:1] + config.empty + (config.blob - config.empty) * bump, sigmoid(features[1:])])


def composite(density: np.ndarray, length: np.ndarray, colors: np.ndarray, distances: np.ndarray) -> dict[str, np.ndarray | float]:
    """One ray, from the eye on (paper equations 1 to 4, NeRF equation 3)."""
    seen, depth, opacity = 0.0, 0.0, 0.0
    color, weights = np.zeros(3), []
    for sigma, delta, tint, distance in zip(density, length, colors, distances, strict=True):
        tau = 0.0 if delta == 0.0 else float(sigma) * float(delta)
        weight = math.exp(-seen) * -math.expm1(-tau)
        color = color + weight * tint
        depth += weight * float(distance)
        opacity += weight
        weights.append(weight)
        seen += tau
    return {
        "color": color,
        "weights": np.array(weights),
        "transmittance": math.exp(-seen),
        "depth": depth / opacity if opacity > 0.0 else 0.0,
        "opacity": opacity,
    }


def ball_transmittance(start: np.ndarray, direction: np.ndarray, radius: float, sigma: float) -> float:
    """exp(-sigma x chord) through a homogeneous ball about the world's origin, which the ray meets from outside."""
    closest = np.linalg.norm(start - (start @ direction) * direction)
    return math.exp(-sigma * 2.0 * math.sqrt(max(radius**2 - float(closest) ** 2, 0.0)))


def cell_of(point: np.ndarray, origin: np.ndarray, bound: float, resolution: int) -> tuple[int, int, int]:
    """The cell that a point lies in, the nearest one for points outside."""
    places = [math.floor((float(x) - float(o) + bound) / (2.0 * bound) * resolution) for x, o in zip(point, origin, strict=True)]
    return tuple(min(max(place, 0), resolution - 1) for place in places)


def geometric(step: int, start: float, end: float, steps: int) -> float:
    """Interpolation of the logarithm (paper appendix C)."""
    share = min(step / steps, 1.0) if steps else 1.0
    return math.exp((1.0 - share) * math.log(start) + share * math.log(end))


def clipped_transmittance(transmittance: np.ndarray, target: np.ndarray) -> float:
    """Paper equation 8 with its sign, averaged over views [V, H, W]."""
    return -sum(min(float(tau), float(view.mean())) for view, tau in zip(transmittance, target, strict=True)) / len(target)


def blur(picture: np.ndarray, deviation: float, reach: int) -> np.ndarray:
    """Gaussian blur [H, W, C]; a pixel is the weighted mean of those neighbours that exist."""
    height, width = picture.shape[:2]
    out = np.zeros_like(picture)
    for row in range(height):
        for column in range(width):
            total, weights = np.zeros(picture.shape[2]), 0.0
            for other_row in range(max(row - reach, 0), min(row + reach + 1, height)):
                for other_column in range(max(column - reach, 0), min(column + reach + 1, width)):
                    square = (other_row - row) ** 2 + (other_column - column) ** 2
                    weight = math.exp(-0.5 * square / deviation**2) if deviation > 0 else float(square == 0)
                    total += weight * picture[other_row, other_column]
                    weights += weight
            out[row, column] = total / weights
    return out


def track_origin(origin: np.ndarray, opacities: np.ndarray, points: np.ndarray, decay: float) -> np.ndarray:
    """Moving average of the centre of mass (paper section 4.6); an empty scene has none."""
    if opacities.sum() <= 1e-6:
        return origin
    return decay * origin + (1.0 - decay) * (opacities[:, None] * points).sum(axis=0) / opacities.sum()


def ranks(cosines: np.ndarray) -> list[int]:
    """Rank of column 0 in each row; whatever is not certainly worse stands before it."""
    out = []
    for row in cosines:
        rank = 1
        for other in row[1:]:
            if math.isnan(row[0]) or math.isnan(other) or other >= row[0]:
                rank += 1
        out.append(rank)
    return out


def slope(function: Callable[[np.ndarray], float], at: np.ndarray, toward: np.ndarray, step: float = 1e-6) -> float:
    """Directional derivative by central differences; error about step^2, and 1e-16 / step from rounding."""
    return (function(at + step * toward) - function(at - step * toward)) / (2.0 * step)


def medium_transmittance(chord: np.ndarray, sigma: float) -> np.ndarray:
    """exp(-sigma chord) of chords [R] through one homogeneous medium; 1 where there is no chord, however dense it is."""
    return np.array([math.exp(-min(float(length) * sigma, 1e6)) if length > 0.0 else 1.0 for length in chord])

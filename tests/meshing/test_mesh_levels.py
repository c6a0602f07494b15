"""Levels by place: counted as a slow loop counts them, the same everywhere for a crisp object, and what haze and thin parts need."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from dreamfields_core.meshing import Views, cast, choose_level, extract_mesh
from dreamfields_core.meshing.isosurface import coarse_values
from dreamfields_core.meshing.lattice import Lattice, Packed, Samples
from dreamfields_core.meshing.level import agreement, highest
from dreamfields_core.meshing.levels import CHOICES, DOUBT, NODES, SPREAD, count_levels, levels_of
from tests.meshing.shapes import cameras, torus

LATTICE = Lattice((0.1, 0.0, -0.05), 1.0, 64)
DENSE, THIN, HAZE = (-0.45, 0.0, -0.1), (0.45, 0.0, -0.1), (0.0, 0.3, 0.65)


def three_balls(points: np.ndarray) -> np.ndarray:
    """Soft ones, of which the haze has larger values than the thin ball."""
    tops = ((DENSE, 5.0, 55.0), (THIN, -0.5, 10.0), (HAZE, 0.4, 20.0))
    return np.maximum.reduce([top - fall * np.square(points - np.asarray(centre)).sum(axis=1) for centre, top, fall in tops])


def opaque(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """1 where a ray meets the dense ball or the thin one, else 0."""
    hit = np.zeros(directions.shape[:-1], bool)
    for centre in (DENSE, THIN):
        to = np.asarray(centre) - origins
        hit |= np.linalg.norm(to - (to * directions).sum(axis=-1, keepdims=True) * directions, axis=-1) < 0.3
    return hit.astype(float)


def test_counting_against_a_slow_loop() -> None:
    rng = np.random.default_rng(0)
    peaks, nodes, solid = rng.standard_normal(60), rng.integers(8, 14, (60, 3)), rng.random(60) > 0.5
    peaks += solid
    found = count_levels(peaks, nodes, solid)
    delta = np.zeros(2 * NODES + 1)
    delta[NODES] = 1
    kernel = gaussian_filter1d(delta, SPREAD)
    choices = np.linspace(min(np.quantile(peaks[solid], 0.001), 0.0), max(np.quantile(peaks[~solid], 0.999), 0.0), CHOICES)
    for corner in ([10, 11, 12], [9, 9, 9], [13, 8, 11], [2, 2, 2]):
        wrong = []
        for choice in choices:
            total = DOUBT / (2 * np.pi * SPREAD**2) ** 1.5 * (choice / (choices[-1] - choices[0])) ** 2
            for peak, node, seen in zip(peaks, nodes, solid, strict=True):
                total += float(np.prod(kernel[node - corner + NODES])) * ((peak > choice) != seen)
            wrong.append(total)
        assert found[tuple(corner)] == np.float32(choices[np.argmin(wrong)])


def test_a_crisp_object_has_one_level_everywhere() -> None:
    origins, directions = cameras(4, 48)
    coarse = coarse_values(Samples(LATTICE, Packed(torus)))
    peaks = np.stack([highest(coarse, LATTICE, origins[v], directions[v])[0] for v in range(4)])
    level, levels = levels_of(Views(origins, directions, (peaks > 0.03).reshape(origins.shape[:-1]).astype(float)), coarse, LATTICE)
    points = np.random.default_rng(1).uniform(-1, 1, (100, 3))
    np.testing.assert_allclose(levels(points), level.value, rtol=1e-6)
    assert level.agreement == 1.0


def test_haze_goes_and_what_is_thin_stays_where_no_single_level_can() -> None:
    origins, directions = cameras(6, 64)
    views = Views(origins, directions, opaque(origins, directions))
    made = extract_mesh(three_balls, lambda p: np.full_like(p, 0.5), views=views, resolution=128, faces=4000)
    assert made.report.components == 2 and made.report.watertight and made.agreement is not None and made.agreement > 0.93
    fresh = cameras(5, 128)
    seen, told = cast(made.mesh, *fresh).hit, opaque(*fresh) > 0.5
    assert (seen & told).sum() / (seen | told).sum() > 0.94
    coarse = coarse_values(Samples(Lattice((0.0, 0.0, 0.0), 1.0, 128), Packed(three_balls)))
    peaks = np.stack([highest(coarse, Lattice((0.0, 0.0, 0.0), 1.0, 128), origins[v], directions[v])[0] for v in range(6)])
    single = choose_level(peaks, views.opacity.reshape(6, -1) > 0.5)
    assert single.agreement < 0.8
    assert np.mean([agreement(peaks[v], told, np.zeros(1)) for v, told in enumerate(views.opacity.reshape(6, -1) > 0.5)]) < 0.85


def test_what_is_known_is_not_asked_again_above_other_levels() -> None:
    def levels(points: np.ndarray) -> np.ndarray:
        return np.asarray(points[:, 0], np.float32)

    samples = Samples(LATTICE, Packed(torus))
    before = coarse_values(samples)
    above = samples.above(levels)
    after, asked = coarse_values(above), above.ask.asked
    assert asked == samples.ask.asked == before.size
    axis = LATTICE.place(np.arange(65)[:, None] * np.ones(3))[:, 0]
    np.testing.assert_allclose(after, before - axis[:, None, None], atol=1e-6)
    corner = np.array([[3, 5, 7]])
    assert above.at(corner) == after[3, 5, 7]
    point = np.array([[0.3, 0.2, 0.1]])
    np.testing.assert_allclose(above.ask(point), torus(point) - 0.3, atol=1e-6)
    assert above.ask.asked == asked + 1

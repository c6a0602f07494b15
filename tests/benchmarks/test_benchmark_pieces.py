"""What benchmarks are made of: the truth they compare with, their ratios, their records, and that they notice what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import dream, mesh, render, step, store
from benchmarks.analytic import ball, chords
from benchmarks.command import UnknownBenchmark, bench, read_options
from benchmarks.record import leave
from benchmarks.timing import Times, ratio, take_turns
from benchmarks.truth import quadrature
from dreamfields_core.rendering.sampling import gaussians_at, place_samples
from tests.rendering.solids import parallel_rays

RAYS = parallel_rays(9)
STARTS, TOWARD = np.asarray(RAYS.origins, np.float64), np.asarray(RAYS.directions, np.float64)


def test_the_quadrature_converges_to_the_closed_form() -> None:
    field, params = ball(radius=render.RADIUS, softness=0.0), {"density": jnp.float32(3.0)}
    errors = []
    for samples in (128, 1024):
        _, transmittance = quadrature(field, params, RAYS, np.zeros(3), bound=1.0, samples=samples, footprint=0.01)
        errors.append(np.abs(transmittance - np.exp(-3.0 * chords(STARTS, TOWARD, radius=render.RADIUS))).max())
    assert errors[0] < 0.1 and errors[1] < 0.02 and transmittance.dtype == np.float64


def test_the_sharp_balls_colour_against_the_quadrature() -> None:
    field, params = ball(radius=render.RADIUS, softness=0.0), {"density": jnp.float32(render.DENSITY)}
    color, transmittance = quadrature(field, params, RAYS, np.zeros(3), bound=1.0, samples=4096, footprint=0.01)
    exact_color, exact_transmittance = render.sharp_truth(RAYS)
    # The edge is found to within a step: density x step / 2 of optical depth, on few rays.
    assert np.sqrt(np.mean((color - exact_color) ** 2)) < 3e-3
    np.testing.assert_allclose(transmittance, exact_transmittance, atol=0.04)


def test_truth_sees_the_field_through_the_renderers_gaussians() -> None:
    """A field that gives back what it is asked about: mean and variances agree with the renderer's at the same places."""
    from benchmarks.truth import _gaussians

    placed = place_samples(None, RAYS, jnp.zeros(3), bound=1.0, count=32)
    ours = gaussians_at(placed, jnp.arange(placed.length.size))
    with jax.enable_x64(True):
        twin = _gaussians(STARTS, TOWARD, np.asarray(RAYS.radii)[:, 0], np.asarray(placed.distances(), np.float64), float(placed.step))
    for name in ("means", "along", "across"):
        np.testing.assert_allclose(getattr(ours, name), getattr(twin, name), rtol=2e-4, atol=1e-6)


def test_a_wrong_picture_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    options = render.Options(scenes=("sharp ball",), size=24, pixels=300, samples=64, counts=(64,), finer=4, rounds=1)
    scene = render.scene_of("sharp ball", options)
    right = {row["way"]: row for row in render.measure(scene, options)}
    moved = render.Scene(scene.field, {"density": jnp.float32(5.0)}, scene.origin, scene.occupancy, scene.truth, scene.pixels)
    wrong = {row["way"]: row for row in render.measure(moved, options)}
    for way in ("dense", "skipping", "refined"):
        assert right[way]["psnr_db"] > wrong[way]["psnr_db"] + 6
    assert right["refined"]["evaluations_a_ray"] < right["skipping"]["evaluations_a_ray"] < right["dense"]["evaluations_a_ray"] == 64


def test_the_headline_is_the_best_within_the_budget() -> None:
    def row(way: str, samples: int, psnr: float, evaluations: float) -> dict:
        return {"way": way, "samples": samples, "psnr_db": psnr, "rms": 10 ** (-psnr / 20), "evaluations_a_ray": evaluations, **TIMES}

    rows = [row("dense", 100, 50.0, 100.0), row("dense", 200, 62.0, 200.0)]
    rows += [row("skipping", 100, 44.0, 3.0), row("skipping", 200, 56.0, 4.9), row("skipping", 400, 68.0, 9.0)]
    found = render.summary(rows, samples=100)
    assert found["ours_psnr_db"] == 56.0 and found["ours_evaluations_fraction"] == 0.049 and found["dense_psnr_db"] == 50.0
    assert found["order"]["dense"] == pytest.approx(12 / 20 / np.log10(2), abs=0.01)


TIMES = {"processor_s": {"median": 1.0}, "wall_s": {"median": 1.0}}


class Pretender:
    """A stepper with a gradient of its own; dense ones take longer."""

    def __init__(self, gradient: np.ndarray, share: float) -> None:
        self.gradient, self.share = gradient, share

    def state(self, turn: int) -> int:
        return turn

    def step(self, state: int) -> tuple[dict, float]:
        return {"a": self.gradient[:2] * (state + 1), "b": self.gradient[2:] * (state + 1)}, self.share


def test_a_wrong_gradient_is_noticed() -> None:
    true = np.array([1.0, 2.0, -1.0, 0.5])
    steppers = {
        "dense": Pretender(true, 1.0),
        "ours": Pretender(3.0 * true, 0.1),
        "wrong": Pretender(true * [1, 1, -1, 1], 0.1),
    }
    rows = step.compare(steppers, rounds=3)  # type: ignore[arg-type]
    assert rows["ours"]["cosine"]["mean"] == pytest.approx(1.0) and rows["ours"]["evaluated"]["median"] == 0.1
    assert rows["wrong"]["cosine"]["mean"] == pytest.approx((1 + 4 - 1 + 0.25) / 6.25)
    assert rows["ours"]["speedup"]["wall"]["count"] == 3


def test_dreams_that_differ_are_noticed() -> None:
    def row(cosine: float) -> dict:
        return {
            "skipping": {"processor_s": 10.0, "cosine": cosine},
            "dense": {"processor_s": 60.0, "cosine": 0.5},
            "hybrid": {"processor_s": 2.0, "cosine": 0.6},
        }

    found = dream.headline([row(0.4), row(0.5), row(0.45)])
    assert found["speedup"] == 6.0 and found["speedup_hybrid"] == 5.0
    assert found["cosine_difference"] == pytest.approx(-0.05) and found["cosine_standard_error"] == pytest.approx(0.05 / 3**0.5)
    sampled = row(0.4)
    del sampled["dense"]["cosine"]
    assert dream.headline([sampled])["cosine_difference"] is None


def test_ratios_are_taken_round_by_round() -> None:
    slow, fast = Times([4.0, 8.0, 6.0], [2.0, 2.0, 2.0]), Times([1.0, 2.0, 3.0], [2.0, 1.0, 4.0])
    assert ratio(slow, fast)["wall"]["median"] == 4.0 and ratio(slow, fast)["processor"]["low"] == 0.75
    order: list[str] = []
    take_turns({"a": lambda turn: order.append("a"), "b": lambda turn: order.append("b")}, rounds=3)
    assert order == ["a", "b", "a", "b", "b", "a", "a", "b"]


def test_the_store_benchmark(tmp_path: Path) -> None:
    path = bench("store", ["--megabytes", "0.1", "0.2", "--rounds", "2"], folder=tmp_path)
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["headline"]["differences"] == 0 and found["headline"]["damage_noticed"] == 1
    assert found["machine"]["cores"] > 0 and found["command"] == "dreamfields bench store --megabytes 0.1 0.2 --rounds 2"
    assert (tmp_path / "store.png").stat().st_size > 5000


def test_the_sample_benchmark(tmp_path: Path) -> None:
    arguments = ["--samples", "300", "--learned", "10", "--chunks", "64", "256", "--angles", "4000", "--rounds", "1"]
    found = json.loads(bench("sample", arguments, folder=tmp_path).read_text(encoding="utf-8"))
    assert found["headline"]["waves_error"] < 2e-7 and set(found["chunks"]) == {"64", "256"}
    assert all(row["learn_us"] > 0 and row["forward_us"] > 0 for row in found["chunks"].values())
    assert (tmp_path / "sample.png").stat().st_size > 5000


def test_a_store_that_believes_anything_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from storage.store import open_store

    credulous = open_store(tmp_path)
    monkeypatch.setattr(store, "get_artifact", lambda store, ref: store.get(ref.key))
    assert not store.notices_damage(credulous, b"x" * 100)


def test_the_mesh_of_a_ball_and_of_a_wrong_one() -> None:
    options = mesh.Options(rounds=1, batch=4096)

    def measured(radius: float) -> dict:
        return mesh.measure(
            lambda points: 20.0 * (radius - np.linalg.norm(points, axis=-1)),
            0.0,
            lambda vertices: np.abs(np.linalg.norm(vertices, axis=-1) - mesh.RADIUS),
            64,
            options,
        )

    right, wrong = measured(mesh.RADIUS), measured(mesh.RADIUS + 0.01)
    assert right["same_mesh"] and right["error"] < 2e-4
    assert wrong["error"] == pytest.approx(0.01, rel=0.05)


def test_a_format_that_mirrors_or_paints_wrong_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from benchmarks import reading
    from dreamfields_core.meshing import FORMATS, to_glb
    from tests.meshing.textured import globe

    glb = to_glb(globe(8), {"caption": "a globe"})

    def found(**writers: Any) -> int:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        monkeypatch.setattr(reading, "FORMATS", {**FORMATS, **writers})
        return reading.differences(glb, folder)

    assert found() == 0
    assert found(stl=lambda mesh, told: FORMATS["stl"](replace(mesh, vertices=mesh.vertices * [1, 1, -1]), told)) == 2
    assert found(ply=lambda mesh, told: FORMATS["ply"](replace(mesh, faces=mesh.faces[:, ::-1]), told)) == 1
    assert (
        found(obj=lambda mesh, told: FORMATS["obj"](replace(mesh, texture=replace(mesh.texture, color=255 - mesh.texture.color)), told))
        == 1
    )


def test_records_refuse_what_says_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a result with a headline"):
        leave("x", {"rows": []}, command="x", folder=tmp_path)
    with pytest.raises(ValueError, match="expected a finite speedup in the headline, got nan"):
        leave("x", {"headline": {"speedup": float("nan")}}, command="x", folder=tmp_path)
    assert not list(tmp_path.iterdir())


def test_options_and_names() -> None:
    options = read_options("step", step.Options, ["--poses", "2", "--ways", "ours", "--settings", "render.size=8", "seed=3"])
    assert options.poses == 2 and options.ways == ("ours",) and options.settings == ("render.size=8", "seed=3") and options.first == 3
    with pytest.raises(UnknownBenchmark, match=r'among step, sample, .*, got "stpe"'):
        bench("stpe", [])

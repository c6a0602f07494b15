"""Every benchmark that dreams, at its smallest, start to end: its JSON has the headline, its plot is there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.command import bench
from tests.tasks.tiny import SETTINGS

pytestmark = pytest.mark.slow

SMALL_FIELD = ("field.frequencies=8", "field.width=16", "field.bottleneck=16", "field.blocks=1")
SMALL_STEP = ("render.size=8", "render.crop=7", "render.samples=8", "augment.copies=2", *SMALL_FIELD)


def run(name: str, *arguments: str, folder: Path) -> dict[str, Any]:
    path = bench(name, arguments, folder=folder)
    assert path.with_suffix(".png").stat().st_size > 3000
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    assert found["name"] == name and found["machine"]["versions"]["jax"] and found["options"]
    return found


def test_step(tmp_path: Path) -> None:
    sizes = ["--poses", "1", "--first", "1", "--ways", "ours", "--growth", "4x8", "--fit-steps", "4", "--dream-steps", "2"]
    # A tenth of the few samples here says little: all are learned from.
    found = run("step", "--settings", *SMALL_STEP, "render.skip.learn=1", "--draft", *SETTINGS, *sizes, folder=tmp_path)
    assert found["headline"].keys() >= {"speedup_settled", "gradient_cosine", "speedup_first_steps"}
    # Nothing is known of the scene at the very first step: all samples inside the cube are evaluated, and the gradient is the dense one.
    assert found["first_steps"]["ours"]["cosine"]["mean"] > 0.999
    assert 0.1 < found["first_steps"]["ours"]["evaluated"]["median"] < 0.9 and found["first_steps"]["dense"]["evaluated"]["median"] == 1
    assert found["growth"]["4x8"]["samples"] == 128


def test_render(tmp_path: Path) -> None:
    sizes = [
        "--size",
        "24",
        "--pixels",
        "300",
        "--samples",
        "64",
        "--counts",
        "32",
        "64",
        "--truth",
        "512",
        "--rounds",
        "1",
        "--finer",
        "4",
    ]
    found = run("render", "--scenes", "dreamed", "--draft", *SETTINGS, *sizes, folder=tmp_path)
    assert found["headline"]["psnr_db"] > 30 and 0 < found["headline"]["evaluations_fraction"] < 1
    dense = {row["samples"]: row for row in found["rows"] if row["way"] == "dense"}
    assert dense[64]["psnr_db"] > dense[32]["psnr_db"] + 6


def test_mesh(tmp_path: Path) -> None:
    found = run("mesh", "--resolutions", "64", "128", "--rounds", "1", "--draft", *SETTINGS, folder=tmp_path)
    assert found["headline"].keys() == {"evaluations_fraction", "speedup", "error_in_cells"}
    assert all(row["same_mesh"] for row in found["rows"])
    assert found["headline"]["evaluations_fraction"] < 0.6


def test_assets(tmp_path: Path) -> None:
    found = run("assets", "--captions", "1", "--fit-steps", "4", "--dream-steps", "1", "--settings", *SETTINGS, folder=tmp_path)
    headline = found["headline"]
    # A network of four steps may show nothing yet: then it is said to, and the rest is measured.
    assert headline["objects"] + headline["empty"] == 2 and headline["closed"] == headline["objects"] >= 1
    assert (headline["usd_findings"], headline["reload_differences"]) == (0, 0)
    assert found["rows"][0]["field"] == "draft" and all(0 < row["silhouette"] <= 1 for row in found["rows"])
    assert all("expected an object" in row["said"] for row in found["empty"])


@pytest.mark.parametrize("dense", ["sampled", "whole"])
def test_dream(tmp_path: Path, dense: str) -> None:
    settings = [*SETTINGS, "render.size=8", "render.crop=7"]
    found = run("dream", "--captions", "1", "--steps", "6", "--dense", dense, "--every", "3", "--settings", *settings, folder=tmp_path)
    assert found["headline"].keys() >= {"speedup", "speedup_hybrid", "cosine_difference", "cosine_standard_error"}
    row = found["rows"][0]
    assert found["headline"]["speedup"] > 0 and -1 <= row["skipping"]["cosine"] <= 1
    assert row["skipping"]["steps"] == row["hybrid"]["steps"] == 6
    if dense == "sampled":
        assert row["dense"]["sampled"]["wall_s"]["count"] == 2 and found["headline"]["cosine_difference"] is None
    else:
        assert row["dense"]["steps"] == len(row["dense"]["looks"]) == 6 and row["dense"]["evaluated_mean"] == 1
        assert found["headline"]["cosine_difference"] == pytest.approx(row["skipping"]["cosine"] - row["dense"]["cosine"])


def test_report(tmp_path: Path) -> None:
    found = run("report", "--objects", "9", "--mesh-bytes", "1000", "--rounds", "2", folder=tmp_path)
    assert found["headline"]["page_bytes"] > 20_000 and [row["wall_s"]["count"] for row in found["rows"]] == [1, 2]
    assert 0 < found["headline"]["again_processor_s"] < 30

"""`dreamfields dream` under a published model: a small CLIP of random weights guides, and another judges."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.encoders import card
from tests.flows.conftest import Dreams
from tests.flows.test_cli_refusals import run
from tests.tasks import full_clip, small_clip


@pytest.mark.slow
def test_a_dream_goes_the_whole_way_under_published_models(dreams: Dreams, tmp_path: Path) -> None:
    guide = str(small_clip.write(tmp_path / "guide"))
    judge = str(small_clip.write(tmp_path / "judge", image_size=48))
    names = ("--guidance", guide, "--judge", f"{judge}+embedded-judge*0.5")
    settings = ("--set", "optim.steps=3", "--set", "guidance.captions=views", "--set", 'guidance.templates=["{}","a photo of {}"]')
    text, result, folder = dreams.dream(*names, *settings, caption="a bust of marble, xyzzy")
    assert "does not know" not in text and result["unknown_words"] == []
    assert result["encoders"]["guidance"] == {"name": guide, "digest": card(guide).digest}
    assert result["encoders"]["same_model"] is False
    assert result["config"]["guidance"]["captions"] == "views"
    assert -1 <= result["scores"][names[-1]]["cosine"] <= 1
    assert (folder / "mesh.glb").stat().st_size > 0


@pytest.mark.slow
def test_a_dream_goes_the_whole_way_under_clip_b32_by_its_short_name(
    dreams: Dreams, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The model has its real size and lies where the hub's client would have put it; 600 MB on disk."""
    monkeypatch.setenv("HF_HOME", str(full_clip.write(tmp_path / "home")))
    _, result, folder = dreams.dream("--guidance", full_clip.MODEL.name, "--set", "optim.steps=3", caption="a bust of marble")
    assert result["encoders"]["guidance"]["name"] == full_clip.MODEL.name and result["seconds"]["optimize"] > 0
    assert (folder / "mesh.glb").stat().st_size > 0


def test_models_are_listed_without_a_network(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run("models", monkeypatch=monkeypatch, capsys=capsys)
    header, *rows = out.splitlines()
    assert code == 0 and header.split()[:2] == ["name", "MB"] and len(rows) > 20
    assert rows[0].split()[:5] == ["embedded", "3", "48", "Apache-2.0", "yes"]
    assert next(row for row in rows if row.startswith("clip-vit-b16 ")).split()[:5] == ["clip-vit-b16", "598", "224", "MIT", "no"]

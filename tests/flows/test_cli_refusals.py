"""Bad input is refused before any work: exit code 2, one sentence with the way out."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from flows import cli

CAPTION = "a red mushroom"
REFUSALS = [
    (["dream", ""], "expected a caption such as"),
    (["dream", "   "], "expected a caption such as"),
    (["dream", "a" * 10_000], "at most 1000 characters, got 10000"),
    (["dream", "a red\nmushroom"], "remove line breaks"),
    (["dream", "xyzzy"], 'words that "embedded" knows'),
    (["dream", "…"], 'words that "embedded" knows'),
    (["dream", CAPTION, "--preset", "hgih"], "a preset among draft, low, medium, high"),
    (["dream", CAPTION, "--set", "mesh.facets=9"], 'no setting "mesh.facets"'),
    (["dream", CAPTION, "--set", "faces=9"], 'no setting "faces"'),
    (["dream", CAPTION, "--set", "mesh"], "expected part.key=value"),
    (["dream", CAPTION, "--set", "mesh.faces=0"], "mesh.faces"),
    (["dream", CAPTION, "--set", "render.size=-4"], "render.size"),
    (["dream", CAPTION, "--set", "render.crop=500"], "render.crop <= render.size"),
    (["dream", CAPTION, "--set", "optim.rate=NaN"], "optim.rate"),
    (["dream", CAPTION, "--set", "scene.bound=Infinity"], "scene.bound"),
    (["dream", CAPTION, "--set", "loss.transmittance=much"], "loss.transmittance"),
    (["dream", CAPTION, "--set", "camera.radius={}"], "camera.radius"),
    (["dream", CAPTION, "--seed", "-1"], "seed"),
    (["dream", CAPTION, "--seed", "1.5"], "valid integer"),
    (["dream", CAPTION, "--guidance", "klip"], "an image-text model among embedded, embedded-judge"),
    (["dream", CAPTION, "--judge", "klip"], "an image-text model among embedded, embedded-judge"),
    (["dream", CAPTION, "--guidance", "clip-vit-b61"], "published ones such as clip-vit-b16"),
    (["dream", CAPTION, "--guidance", "clip-vit-b16"], "use --guidance embedded, or give the path of a folder"),
    (["dream", CAPTION, "--guidance", "embedded*no"], "NAME*WEIGHT with a positive weight"),
    (["dream", CAPTION, "--guidance", "embedded-judge"], "state --judge embedded-judge to have it so"),
    (["dream", CAPTION, "--store", "ftp://somewhere"], "s3://bucket/prefix"),
    (["dream", CAPTION, "--store", "memory://"], "several processes"),
    (["dream", CAPTION, "--store", "/dev/null/store"], "/dev/null"),
    (["dream", CAPTION, "--out", "/dev/null/out"], "choose another with --out"),
    (["dream"], "missing argument 'caption': see `dreamfields dream --help`"),
    (["dream", CAPTION, "--face", "9"], "--face"),
    (["sweep"], "write for instance `dreamfields sweep embedded:12`"),
    (["sweep", "captions.yaml"], "expected captions from coco"),
    (["sweep", "coco"], "put the file there, or use embedded:12"),
    (["sweep", "embedded:2", "--table", "tabel"], "expected a table among"),
    (["sweep", "embedded:2", "--table", "cameras", "--variants", "round"], "among the rows of cameras"),
    (["sweep", "embedded:2", "--seeds", "0,x"], "whole numbers as seeds"),
    (["settings", "--preset", "hgih"], "a preset among"),
    (["draem", CAPTION], "draem"),
    (["mesh", CAPTION], "a dream's folder, or a record's key or a caption"),
    (["mesh", CAPTION, "--format", "fbx"], "a format among glb"),
    (["mesh", "a" * 300], "a dream's folder, or a record's key or a caption"),
    (["mesh", CAPTION, "--store", "ftp://somewhere"], "s3://bucket/prefix"),
    (["pull", "--store", "s3://"], "s3://bucket/prefix"),
    (["report", "--store", "ftp://somewhere"], "s3://bucket/prefix"),
    (["pull"], "a store with dreams in it"),
    (["pull", "--format", "fbx"], "a format among glb"),
    (["pull", "--since", "yesterday"], "a date such as 2026-11-21"),
]


def run(*arguments: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """The command in this process: exit code, output, errors."""
    monkeypatch.setattr(sys, "argv", ["dreamfields", *arguments])
    with pytest.raises(SystemExit) as end:
        cli.main()
    out, err = capsys.readouterr()
    return int(end.value.code or 0), out, err


@pytest.mark.parametrize(("arguments", "sentence"), REFUSALS, ids=lambda value: " ".join(value)[:40] if isinstance(value, list) else "")
def test_refused(
    arguments: list[str], sentence: str, home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(*arguments, monkeypatch=monkeypatch, capsys=capsys)
    assert code == 2, err
    assert sentence in err
    assert err.startswith("dreamfields: ") and err.count("\n") == 1 and len(err) < 400
    assert out == ""
    assert not list(home.rglob("result.json")) and not list(home.rglob("runs"))


@pytest.mark.parametrize(
    ("command", "where"), [("mesh", "flows.remesh.remesh"), ("pull", "flows.pull.pull"), ("dream", "flows.cli.take_order")]
)
def test_ctrl_c_is_told(command: str, where: str, home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(*arguments: object, **more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(where, interrupted)
    code, _, err = run(command, *[CAPTION] * (command != "pull"), monkeypatch=monkeypatch, capsys=capsys)
    assert code == 130 and err == "dreamfields: interrupted: nothing is lost, the same command goes on\n"


@pytest.mark.parametrize("command", [[], ["dream"], ["sweep"], ["settings"], ["models"], ["mesh"], ["pull"]])
def test_help_has_an_example(command: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(*command, "--help", monkeypatch=monkeypatch, capsys=capsys)
    assert code == 0
    assert f"Example: dreamfields {command[0] if command else 'dream'}" in out


def test_settings_are_lines_that_set_takes_back(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run("settings", "--set", "mesh.faces=5000", monkeypatch=monkeypatch, capsys=capsys)
    assert code == 0 and "mesh.faces=5000\n" in out and "optim.rate_end=0.003\n" in out
    again = [argument for line in out.splitlines() for argument in ("--set", line)]
    assert run("settings", "--preset", "high", *again, monkeypatch=monkeypatch, capsys=capsys)[1] == out

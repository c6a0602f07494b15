"""`dreamfields bench`: refuses in one sentence, passes options on, says the headline."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks.command import BENCHMARKS
from flows import cli


def run(*arguments: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """The command in this process: exit code, output, errors."""
    monkeypatch.setattr(sys, "argv", ["dreamfields", *arguments])
    with pytest.raises(SystemExit) as end:
        cli.main()
    out, err = capsys.readouterr()
    return int(end.value.code or 0), out, err


def test_an_unknown_benchmark_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run("bench", "stpe", monkeypatch=monkeypatch, capsys=capsys)
    assert code == 2 and out == ""
    names = ", ".join(BENCHMARKS)
    assert err == f'dreamfields: expected a benchmark among {names}, got "stpe"\n' and "assets" in names


def test_help_has_an_example(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run("bench", "--help", monkeypatch=monkeypatch, capsys=capsys)
    assert code == 0 and "Example: dreamfields bench step" in out


def test_options_reach_the_benchmark_and_the_headline_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["bench", "store", "--out", str(tmp_path), "--megabytes", "0.1", "--rounds", "1"]
    code, out, err = run(*arguments, monkeypatch=monkeypatch, capsys=capsys)
    assert code == 0, err
    assert "damage_noticed               1" in out and str(tmp_path / "store.json") in out
    assert run("bench", "store", "--megabits", "1", monkeypatch=monkeypatch, capsys=capsys)[0] == 2


def test_without_a_checkout_it_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from flows import measuring

    monkeypatch.setattr(measuring, "__file__", "/nowhere/flows/measuring.py")
    code, _, err = run("bench", "store", monkeypatch=monkeypatch, capsys=capsys)
    assert code == 2 and "expected a checkout" in err

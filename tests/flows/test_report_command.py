"""`dreamfields report`: a stored sweep's page, written anew from the store alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from storage.digests import json_digest
from storage.steps import StepRecord, put_record
from storage.store import open_store
from tests.flows.swept import keep_dream
from tests.flows.test_cli_refusals import run
from tests.reporting.objects import JUDGE
from tests.reporting.test_markup import Reader


def keep_sweep(folder: Path, name: str, *, created: str) -> None:
    """A sweep of two objects and a failure."""
    store = open_store(folder)
    dreams = [keep_dream(store, caption, 0, rank=rank) for caption, rank in (("a red mushroom", 1), ("a blue house", 7))]
    entries = [{"variant": "as preset", "caption": dream.inputs["caption"], "seed": 0, "key": dream.key, "error": None} for dream in dreams]
    entries.append({"variant": "as preset", "caption": "a <b>bold</b> chair", "seed": 0, "key": None, "error": "expected words, got none"})
    values = {"name": name, "source": "captions.txt", "table": None, "preset": "draft", "judges": [JUDGE], "entries": entries, "oracle": []}
    put_record(store, StepRecord("sweep", 1, json_digest(name), created=created, code_version="1.2", values=values))


@pytest.fixture
def kept(home: Path) -> Path:
    """A store with two sweeps."""
    keep_sweep(home / "store", "coco-table3-draft", created="2026-11-20T00:00:00+00:00")
    keep_sweep(home / "store", "embedded-12-draft", created="2026-11-21T00:00:00+00:00")
    return home


def test_the_newest_sweep_is_reported(kept: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run("report", "--store", "store", "--to", "page", monkeypatch=monkeypatch, capsys=capsys)
    assert code == 0 and out == "page/embedded-12-draft.html\n"
    read = Reader((kept / out.strip()).read_text(encoding="utf-8"))
    assert "a red mushroom" in read.text and "a <b>bold</b> chair" in read.text and "expected words, got none" in read.text
    places = [attributes["src"] for tag, attributes in read.tags if tag == "img"]
    assert len(places) == 2 and all((kept / "page" / place).is_file() for place in places)


def test_a_sweep_is_named_by_the_beginning_of_its_name(
    kept: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("report", "coco", "--store", "store", "--to", "page", monkeypatch=monkeypatch, capsys=capsys)[0] == 0
    assert (kept / "page" / "coco-table3-draft.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "found"), [(["table9", "--store", "store"], "found 0"), (["--store", "empty"], "found 0; there are none")]
)
def test_a_sweep_that_is_not_there_is_refused(
    arguments: list[str], found: str, kept: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = run("report", *arguments, monkeypatch=monkeypatch, capsys=capsys)
    assert code == 2 and found in err and err.count("\n") == 1

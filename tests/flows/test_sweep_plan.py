"""What a sweep asks for, and what it refuses before any work."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from prefect.exceptions import ParameterTypeError

from dreamfields_core.config import ConfigError
from flows import sweep_oracle, sweep_plan
from flows.coco_sweep import coco_sweep
from flows.order import OrderError, dream_key, take_order
from flows.sweep_plan import PLAIN, listed, plan_sweep, seeds_of
from flows.sweep_record import TRUTHS, entries, keep_sweep, members, missing, sweeps
from flows.tables import TableError, load_table
from flows.tables.types import Column
from storage.artifacts import put_artifact
from storage.steps import StepRecord, put_record
from storage.store import open_store
from tasks.caption_sets import captions_from
from tasks.encoders import EncoderError
from tasks.step import Place
from tests.tasks.tiny import SETTINGS


@pytest.fixture
def lines(tmp_path: Path) -> str:
    """Three captions, one of which no embedded model understands."""
    (tmp_path / "captions.txt").write_text("a red mushroom\nxyzzy\na blue house\n")
    return str(tmp_path / "captions.txt")


def plan(source: str | None, out: Path, **wishes: Any) -> Any:
    return plan_sweep(source, out=out, settings=SETTINGS, **wishes)


def test_captions_times_seeds_times_rows_of_the_table(tmp_path: Path) -> None:
    rows = [row.name for row in load_table("cameras").rows]
    found = plan("embedded:3", tmp_path, table="cameras", seeds=(0, 7))
    wanted = {(row, caption, seed) for row in rows for caption in found.captions.captions for seed in (0, 7)}
    assert {(cell.variant, cell.caption, cell.seed) for cell in found.cells} == wanted and len(found.cells) == len(wanted)
    assert len({cell.key for cell in found.cells}) == len(wanted)
    two = plan("embedded:3", tmp_path, table="cameras", seeds=(0, 7), variants=rows[:2])
    assert {cell.key for cell in two.cells} < {cell.key for cell in found.cells} and two.name != found.name


def test_a_table_brings_its_own_captions_seeds_and_judges(tmp_path: Path) -> None:
    table, found = load_table("cameras"), plan(None, tmp_path, table="cameras")
    own = table.captions["draft"]
    assert found.captions.captions == (captions_from(own).captions if isinstance(own, str) else own)
    assert {cell.seed for cell in found.cells} == set(table.seeds["draft"])
    assert found.judges == tuple(column.judges["draft"] for column in table.columns_at("draft"))


def test_the_same_wishes_have_the_same_name_and_others_another(tmp_path: Path) -> None:
    name = plan("embedded:3", tmp_path).name
    assert plan("embedded:3", tmp_path / "elsewhere").name == name
    assert len({name, plan("embedded:4", tmp_path).name, plan("embedded:3", tmp_path, seeds=[1]).name}) == 3


def test_what_is_only_scored_is_the_same_sweep_with_the_same_keys(tmp_path: Path) -> None:
    whole, scored = plan("embedded:2", tmp_path), plan("embedded:2", tmp_path, score_only=True)
    assert scored.name == whole.name and [cell.key for cell in scored.cells] == [cell.key for cell in whole.cells]
    assert all(cell.order.score_only and cell.parameters["score_only"] for cell in scored.cells)
    store = open_store(whole.store)
    keep_sweep(scored, store, {str(scored.cells[0].key): "the lamp went out"})
    (record,) = sweeps(store)
    assert [entry.error for entry in entries(record, store, tmp_path)] == ["the lamp went out", "not dreamed yet"]
    for cell in whole.cells:
        put_record(store, StepRecord("scored", 1, str(cell.key), inputs={"caption": cell.caption}, config={}, values={"scores": {}}))
    assert [entry.error for entry in entries(record, store, tmp_path)] == ["the lamp went out", None]


def test_a_caption_that_cannot_be_dreamed_is_an_error_of_its_own(lines: str, tmp_path: Path) -> None:
    found = plan(lines, tmp_path)
    assert [cell.caption for cell in found.cells if cell.error] == ["xyzzy"]
    store = open_store(found.store)
    assert [cell.caption for cell in missing(found, store)] == ["a red mushroom", "a blue house"]
    keep_sweep(found, store, {found.cells[0].key: "the lamp went out"})
    (record,) = sweeps(store)
    kept = members(record)
    assert [(member.caption, member.variant, member.key is None) for member in kept] == [
        ("a red mushroom", PLAIN, False),
        ("xyzzy", PLAIN, True),
        ("a blue house", PLAIN, False),
    ]
    assert kept[0].error == "the lamp went out" and "words" in str(kept[1].error) and kept[2].error is None


def test_the_key_tells_captions_judged_in_a_set_of_their_own(lines: str, tmp_path: Path) -> None:
    among = plan(lines, tmp_path).cells[0]
    assert among.parameters["among"] == ["a red mushroom.", "xyzzy.", "a blue house."]
    (tmp_path / "spoken.txt").write_text("a red mushroom\n")
    alone = plan(str(tmp_path / "spoken.txt"), tmp_path).cells[0]
    assert alone.parameters["among"] is None and among.key != alone.key == dream_key(alone.caption, alone.order.config)
    assert among.order.folder != alone.order.folder, "two dreams would write into one folder"


@pytest.mark.parametrize(
    ("wishes", "kind", "sentence"),
    [
        ({"table": "none"}, TableError, "expected a table among"),
        ({"table": "cameras", "variants": ["round"]}, OrderError, r'among the rows of cameras \(one viewpoint, .*got "round"'),
        ({"variants": ["round"]}, OrderError, "add --table"),
        ({"seeds": [1, 1]}, OrderError, "different seeds"),
        ({"seeds": [-1]}, ConfigError, "seed"),
        ({"preset": "hgih"}, ConfigError, "a preset among"),
        ({"judge": "embedded", "guidance": "klip"}, ValueError, "an image-text model among"),
        ({"store": "memory://"}, OrderError, "several processes"),
    ],
)
def test_what_concerns_all_refuses_the_whole(wishes: dict, kind: type[Exception], sentence: str, tmp_path: Path) -> None:
    with pytest.raises(kind, match=sentence):
        plan("embedded:2", tmp_path, **wishes)


def test_further_judges_are_looked_up_before_anything_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(EncoderError, match="an image-text model among"):
        take_order("a red mushroom", out=tmp_path / "out", judges=("clip-vit-b61",))
    assert not (tmp_path / "out").exists()
    table = load_table("cameras")
    unknown = Column("another", {"paper": "clip-vit-b61", "draft": "clip-vit-b61"})
    monkeypatch.setattr(sweep_plan, "load_table", lambda name: replace(table, columns=(*table.columns, unknown)))
    with pytest.raises(EncoderError, match="an image-text model among"):
        plan(None, tmp_path, table="cameras")


def test_begun_again_a_sweep_keeps_what_was_written_down_until_there_is_more(lines: str, tmp_path: Path) -> None:
    found = plan(lines, tmp_path)
    store, key = open_store(found.store), str(found.cells[0].key)
    truth = {"caption": "a red mushroom", "scores": {}, "poster": {}}
    keep_sweep(found, store, {key: "the lamp went out"}, [truth])
    again = keep_sweep(found, store)
    assert members(again)[0].error == "the lamp went out" and again.values["oracle"] == [truth]
    ended = keep_sweep(found, store, {}, [])
    assert members(ended)[0].error is None and ended.values["oracle"] == [] and "words" in str(members(ended)[1].error)


def test_a_lost_picture_costs_no_report(lines: str, tmp_path: Path) -> None:
    found = plan(lines, tmp_path)
    store = open_store(found.store)
    kept, lost = (put_artifact(store, "poster.webp", data, "image/webp") for data in (b"kept", b"lost"))
    oracle = [{"caption": ref.name, "scores": {}, "poster": ref.to_json()} for ref in (lost, kept)]
    store.delete(lost.key)
    shown = list(entries(keep_sweep(found, store, {}, oracle), store, tmp_path))
    assert [(entry.variant, len(entry.files)) for entry in shown[:2]] == [(TRUTHS, 0), (TRUTHS, 1)] and len(shown) == 5


def test_a_true_picture_that_is_not_there_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def perform(*arguments: Any) -> None:
        raise ValueError("no judge today")

    monkeypatch.setattr(sweep_oracle, "perform", perform)
    (tmp_path / "captions.csv").write_text("caption,picture\na red mushroom,\nxyzzy,gone.png\n")
    told: list[str] = []
    place = Place(open_store(tmp_path / "store"), lambda event: told.append(event["text"]))
    assert sweep_oracle.oracle_of(plan(str(tmp_path / "captions.csv"), tmp_path), place) == []
    assert len(told) == 2 and "no judge today" in told[0] and "“xyzzy”" in told[1] and "gone.png, found none" in told[1]


def test_no_captions_at_all_says_what_to_write(tmp_path: Path) -> None:
    with pytest.raises(OrderError, match="dreamfields sweep embedded:12"):
        plan(None, tmp_path)


def test_lists_of_the_command_line() -> None:
    assert listed("none, clipped gated,,") == ["none", "clipped gated"] and seeds_of("0,1") == [0, 1] and seeds_of("") == []
    with pytest.raises(OrderError, match="whole numbers"):
        seeds_of("0,b")


@pytest.mark.parametrize(
    "wrong",
    [
        {"captions": ""},
        {"captions": "coco", "through": "dusk"},
        {"captions": "coco", "workers": 0},
        {"captions": "coco", "scheduler": "somewhere"},
        {"captions": "coco", "seeds": [-1]},
        {"captions": "coco", "seeds": "0,1"},
        {"captions": "coco", "settings": ["mesh.faces"]},
        {"captions": "coco", "preset": "hgih"},
    ],
)
def test_parameters_are_refused_before_a_run(wrong: dict) -> None:
    with pytest.raises(ParameterTypeError):
        coco_sweep.validate_parameters(wrong)

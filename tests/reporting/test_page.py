"""The page as text: the same bytes twice, nothing from elsewhere, no caption that is more than text, every number where it belongs."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from urllib.parse import unquote

import pytest

from dreamfields_core.reporting.cells import plain_rows, result_table
from dreamfields_core.reporting.contract import Change, Entry, Figure, Night, Report, Row
from dreamfields_core.reporting.page import render_report
from tests.reporting.objects import JUDGE, entry, result
from tests.reporting.test_markup import Reader

HOSTILE = [
    "<script>alert(1)</script>",
    "\"><img src=x onerror='alert(1)'>",
    "كرسي أحمر على شكل أفوكادو",
    "🐌 a snail made of baguette 🥖",
    "a & b &lt;c&gt; 'quoted' \"twice\"",
    "</script><style>*{display:none}</style>",
]
FILES = {
    "turntable.webp": "files/a b#c.webp",
    "poster.webp": "files/a%.webp",
    "mesh.glb": "files/m.glb",
    "view.html": "javascript:alert(1)",
}


def report() -> Report:
    """Two variants, a row without objects, a failure, a night."""
    objects = [
        entry("none", "a red mushroom", 0, 4),
        entry("none", "a blue house", 0, 1),
        entry("none", "a blue house", 1, None),
        entry("ours", "a red mushroom", 0, 1, mesh=2),
        entry("ours", "a blue house", 0, 1),
    ]
    rows = (
        Row("oracle", (Figure("CLIP B/32", 0.771, 0.034),), reference=True),
        Row("none", (Figure("CLIP B/32", 0.314, 0.027), Figure("LiT B/32", 0.889, 0.018, own=True))),
        Row("ours"),
    )
    night = Night("2026-11-20", (Change("none", JUDGE, "random", "field", 0.75, 0.5, 0.125, 2, True),))
    return Report("Regularisers", tuple(objects), rows, (JUDGE,), night, {"date": "2026-11-21"})


def test_the_same_report_is_the_same_page() -> None:
    assert render_report(report()) == render_report(report())


def test_the_table_says_means_errors_differences_and_the_papers_figures() -> None:
    by_name = {row["variant"]: row for row in plain_rows(result_table(report(), JUDGE))}
    none, ours, oracle = by_name["none"], by_name["ours"], by_name["oracle"]
    assert (none["objects"], none["failed"]) == ("2", "1")
    assert none["among 153 captions: Field"] == "50.0 ± 50.0" and ours["among 153 captions: Field"] == "100.0 ± 0.0"
    assert ours["among 153 captions: Mesh"] == "50.0 ± 50.0"
    assert ours["among 153 captions: Difference"] == "+50.0 ± 50.0" and none["among 153 captions: Difference"] == ""
    assert ours["among 36 of the same colours: Field"] == "0.0 ± 0.0"
    assert ours["Cosine"] == "0.250 ± 0.000"
    assert oracle["Paper: CLIP B/32"] == "77.1 ± 3.4" and oracle["among 153 captions: Field"] == ""
    page = render_report(report())
    assert "<b>100.0</b>" in page and "<b>77.1</b>" not in page
    assert "<i>(88.9)</i>" in page, "the paper's own over-fit figure is set apart, and never the best"


def test_a_judge_that_guided_is_set_apart() -> None:
    objects = tuple(Entry("ours", str(i), 0, {**result(1), "encoders": {"guidance": {"name": JUDGE}}}) for i in range(2))
    rivals = tuple(entry("other", str(i), 0, i + 1) for i in range(2))
    cells = {line.variant: line.cells[0] for line in result_table(Report("", objects + rivals, judges=(JUDGE,)), JUDGE).lines}
    assert cells["ours"] and cells["ours"].own and not cells["ours"].best
    assert cells["other"] and not cells["other"].own


def test_true_pictures_are_neither_the_base_nor_the_best() -> None:
    truths = tuple(entry("truth", caption, 0, 1) for caption in ("a red mushroom", "a blue house"))
    with_truths = replace(report(), entries=truths + report().entries, rows=(Row("truth", reference=True), *report().rows))
    lines = {line.variant: line for line in result_table(with_truths, JUDGE).lines}
    assert lines["ours"].cells == {line.variant: line for line in result_table(report(), JUDGE).lines}["ours"].cells
    first, mesh, difference = lines["truth"].cells[:3]
    assert first and mesh and first.value == 1 and not first.best and not mesh.best and difference is None
    assert "objects4failures1" in Reader(render_report(with_truths)).text.replace(" ", "")


def test_what_fell_and_what_failed_is_said_in_words() -> None:
    read = Reader(render_report(report()))
    assert "1 of 1 comparisons fell by more than the standard error since 2026-11-20" in read.text
    assert "▼ fell" in read.text and "−25.0 ± 12.5" in read.text
    assert read.text.count("expected finite steps, but step 7 is not finite: lower optim.rate") == 2, "among the failures and on its card"


@pytest.mark.parametrize("caption", HOSTILE)
def test_no_caption_is_more_than_text(caption: str) -> None:
    plain = Reader(render_report(with_text("a red mushroom")))
    read = Reader(render_report(with_text(caption)))
    assert [tag for tag, _ in read.tags] == [tag for tag, _ in plain.tags]
    assert caption in read.text
    assert any(caption in attributes.get("alt", "") for tag, attributes in read.tags if tag == "img")


def with_text(text: str) -> Report:
    """A report in which every text from outside is `text`."""
    objects = (Entry(text, text, 0, result(1), files=FILES), Entry(text, text, 1, error=text))
    night = Night(text, (Change(text, text, "random", "field", 1, 0, 0.1, 1, True),))
    return Report(text, objects, (Row(text, (Figure(text, 0.5),)),), (JUDGE,), night, {text: text})


def test_nothing_comes_from_elsewhere() -> None:
    read = Reader(render_report(with_text("http://example.org/a.png")))
    places = [
        attributes[name] for _, attributes in read.tags for name in ("src", "href", "data-turn", "data-still") if attributes.get(name)
    ]
    assert places and all(place.startswith(("#", "data:,", "files/", "javascript%3A")) for place in places)
    assert "files/a b#c.webp" in map(unquote, places) and "files/a%.webp" in map(unquote, places)


def test_the_only_script_is_the_one_that_the_policy_names() -> None:
    page = render_report(with_text(HOSTILE[0]))
    scripts = re.findall("<script>(.*?)</script>", page, flags=re.DOTALL)
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    assert f"script-src &#x27;sha256-{digest}&#x27;" in page and "default-src &#x27;none&#x27;" in page


def test_an_empty_sweep_is_a_page_too() -> None:
    for empty in (Report("Nothing yet", ()), replace(report(), entries=())):
        read = Reader(render_report(empty))
        assert "0 of 0 objects" in read.text and "nan" not in read.text


def test_one_object_has_no_standard_error() -> None:
    row = plain_rows(result_table(Report("", (entry("ours", "a", 0, 1),), judges=(JUDGE,)), JUDGE))[0]
    assert row["among 153 captions: Field"] == "100.0"


def test_without_meshes_there_is_no_column_for_them() -> None:
    full = entry("ours", "a", 0, 1)
    assert full.result is not None
    scores = {JUDGE: {name: said for name, said in full.result["scores"][JUDGE].items() if name != "mesh"}}
    scored = Report("", (replace(full, result={**full.result, "scores": scores}),), judges=(JUDGE,))
    with_mesh, without = (result_table(one, JUDGE) for one in (Report("", (full,), judges=(JUDGE,)), scored))
    kept = [(column, cell) for column, cell in zip(with_mesh.columns, with_mesh.lines[0].cells) if column.name != "Mesh"]
    assert list(zip(without.columns, without.lines[0].cells)) == kept and len(with_mesh.columns) == len(kept) + 2
    assert "Mesh" not in [column.name for column in without.columns] and "Cosine" in render_report(scored)


def test_cards_carry_what_the_filter_asks_for() -> None:
    cards = [attributes for tag, attributes in Reader(render_report(report())).tags if tag == "li"]
    assert [card["data-state"] for card in cards] == ["wrong", "right", "failed", "right", "right"]
    assert cards[0]["data-text"] == "a red mushroom none seed 0" and cards[3]["data-variant"] == "ours"

"""What a page needs lies beside it: copied once, never a still of another film, whole although the store has losses."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from prefect import flow
from prefect.artifacts import Artifact
from prefect.testing.utilities import prefect_test_harness

from dreamfields_core.reporting.contract import Entry, Report
from dreamfields_core.reporting.curves import POINTS
from dreamfields_core.reporting.pictures import montage, still
from flows.report import lay_out, read_history, show_report, write_page
from flows.result import find_made
from storage.artifacts import get_artifact
from storage.contract import Store
from storage.steps import StepRecord, put_record
from tests.flows.swept import SIDE, STEPS, keep_dream, keep_scored
from tests.reporting.objects import JUDGE, entry, result


@pytest.fixture
def dream(store: Store) -> StepRecord:
    return keep_dream(store, "a red mushroom", 0)


def times(folder: Path) -> dict[str, int]:
    """When each file was written."""
    return {path.relative_to(folder).as_posix(): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def test_what_is_shown_is_copied_and_nothing_else(dream: StepRecord, store: Store, tmp_path: Path) -> None:
    files = lay_out(dream, store, tmp_path / "out", "mushroom")
    assert set(files) == {"turntable.webp", "contact_sheet.png", "mesh.glb", "poster.webp"}
    assert all((tmp_path / "out" / path).is_file() for path in files.values())
    assert set(times(tmp_path / "out")) == set(files.values())
    first = still((tmp_path / "out" / files["turntable.webp"]).read_bytes())
    np.testing.assert_allclose(still((tmp_path / "out" / files["poster.webp"]).read_bytes()), first, atol=6)


def test_a_second_time_no_file_is_written(dream: StepRecord, store: Store, tmp_path: Path) -> None:
    first, before = lay_out(dream, store, tmp_path / "out", "mushroom"), times(tmp_path / "out")
    assert lay_out(dream, store, tmp_path / "out", "mushroom") == first
    assert times(tmp_path / "out") == before


def test_another_film_gets_a_still_of_its_own(dream: StepRecord, store: Store, tmp_path: Path) -> None:
    old = lay_out(dream, store, tmp_path, "mushroom")
    new = lay_out(keep_dream(store, "a red mushroom", 0, shade=1), store, tmp_path, "mushroom")
    assert new["turntable.webp"] == old["turntable.webp"] and new["poster.webp"] != old["poster.webp"]
    shown, film = (still((tmp_path / new[name]).read_bytes()) for name in ("poster.webp", "turntable.webp"))
    np.testing.assert_allclose(shown, film, atol=6)


def test_what_the_store_has_lost_is_left_out(dream: StepRecord, store: Store, tmp_path: Path) -> None:
    store.delete(dream.output("turntable.webp").key)
    store.put(dream.output("mesh.glb").key, b"damaged")
    assert set(lay_out(dream, store, tmp_path / "out", "mushroom")) == {"contact_sheet.png"}
    store.put(dream.output("history.npz").key, b"damaged")
    assert read_history(dream, store) is None


def test_a_view_page_that_is_there_is_led_to(dream: StepRecord, store: Store, tmp_path: Path) -> None:
    (tmp_path / "mushroom").mkdir()
    (tmp_path / "mushroom" / "view.html").write_text("view")
    assert lay_out(dream, store, tmp_path, "mushroom")["view.html"] == "mushroom/view.html"


def test_histories_are_thinned(dream: StepRecord, store: Store) -> None:
    history = read_history(dream, store)
    assert history is not None and set(history) == {"step", "loss", "similarity", "transmittance"}
    assert len(history["step"]) == len(history["loss"]) == POINTS and history["step"][-1] == STEPS


def test_the_first_judges_ranks_on_the_way_are_a_curve(store: Store) -> None:
    learning = {"steps": [50, 100, 150, STEPS], "ranks": [7, 1, 1, 2]}
    history = read_history(keep_dream(store, "a red mushroom", 0, learning=learning), store)
    assert history is not None and len(history["correct"]) == POINTS
    known_at = {round(step): value for step, value in zip(history["step"], history["correct"]) if not np.isnan(value)}
    assert list(known_at.values()) == [0.0, 1.0, 1.0, 0.0] and list(known_at)[-1] == STEPS


def test_of_what_was_only_scored_the_first_view_is_shown(store: Store, tmp_path: Path) -> None:
    scored = keep_scored(store, "a red mushroom", 3)
    files = lay_out(scored, store, tmp_path / "out", "mushroom")
    assert set(files) == {"poster.webp"} and read_history(scored, store) is None
    with np.load(io.BytesIO(get_artifact(store, scored.output("views.npz")))) as seen:
        first = 255 * seen["views"][0].mean(axis=(0, 1))
    shown = still((tmp_path / "out" / files["poster.webp"]).read_bytes())
    assert shown.shape == (SIDE, SIDE, 3)
    np.testing.assert_allclose(shown.mean(axis=(0, 1)), first, atol=6)


def test_an_object_with_a_mesh_is_preferred_to_its_score(store: Store) -> None:
    scored = keep_scored(store, "a red mushroom", 0)
    assert find_made(store, scored.key) == scored
    whole = keep_dream(store, "a red mushroom", 0)
    assert whole.key == scored.key and find_made(store, scored.key) == whole


def test_what_was_scored_later_than_the_mesh_is_what_counts(store: Store) -> None:
    whole = keep_dream(store, "a red mushroom", 0)
    later = put_record(store, replace(keep_scored(store, "a red mushroom", 0, rank=7), created="2999-01-01T00:00:00+00:00"))
    assert find_made(store, whole.key) == later


def test_the_page_is_written_whole(tmp_path: Path) -> None:
    report = Report("Sweep", (entry("ours", "a red mushroom", 0, 1),), judges=(JUDGE,))
    path = write_page(report, tmp_path / "out" / "sweep.html")
    text = path.read_bytes()
    assert text.startswith(b"<!doctype html>") and text.endswith(b"</html>\n") and b"\r" not in text
    assert write_page(report, path).read_bytes() == text and list(path.parent.iterdir()) == [path]


def test_a_montage_has_a_square_for_each() -> None:
    colors = [(255, 0, 0), (0, 255, 0), (0, 0, 255)]
    sheet = montage([np.full((8, 8, 3), color, np.uint8) for color in colors], columns=2, side=4, gap=2)
    assert sheet.shape == (10, 10, 3)
    assert [tuple(sheet[y, x]) for y, x in ((0, 0), (0, 6), (6, 0))] == colors
    assert (sheet[6, 6] == 255).all() and (sheet[0, 4] == 255).all()


def test_outside_of_a_flow_run_nothing_is_shown(tmp_path: Path) -> None:
    show_report(Report("Sweep", (entry("ours", "a", 0, 1),), judges=(JUDGE,)), tmp_path)


@pytest.mark.slow
def test_a_flow_run_shows_the_table_the_objects_and_the_failures(dream: StepRecord, store: Store, tmp_path: Path) -> None:
    files = lay_out(dream, store, tmp_path, "mushroom")
    objects = (Entry("ours", "a red mushroom", 0, result(1), files=files), entry("ours", "a blue house", 0, None))

    @flow
    def sweep() -> None:
        show_report(Report("Sweep", objects, judges=(JUDGE,)), tmp_path)

    with prefect_test_harness(server_startup_timeout=120):
        sweep()
        found = {key: str(Artifact.get(key).data) for key in ("sweep-table", "sweep-failures", "sweep-gallery")}  # type: ignore[union-attr]
    assert '"among 153 captions: Field": "100.0"' in found["sweep-table"]
    assert "not finite" in found["sweep-failures"]
    assert found["sweep-gallery"].startswith("data:image/webp;base64,")

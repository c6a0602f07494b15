"""The page as Chromium shows it from a folder: pictures load, sorting and filtering work, nothing complains, nothing leaves the folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dreamfields_core.rendering.pictures import webp, webp_animation
from dreamfields_core.reporting.contract import Entry
from dreamfields_core.reporting.page import render_report
from tests.reporting.browser import CHROMIUM, Browser
from tests.reporting.test_page import HOSTILE, report

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium, found none on the path (on Debian: apt-get install chromium)"),
]
COLUMN = "[...document.querySelectorAll('table.results tbody tr')].map(row => row.cells[{}].textContent)"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of test_page.py, every caption hostile, with pictures in a folder of an awkward name."""
    folder = tmp_path_factory.mktemp("a report #1 100%")
    rng = np.random.default_rng(0)
    objects = []
    history = {"step": (1, 2, 3), "loss": (0.5, 0.25, 0.125), "transmittance": (0.5, 0.75, 0.875)}
    for number, one in enumerate([*report().entries, *report().entries]):
        frames = [np.full((16, 16, 3), color, np.uint8) for color in rng.integers(0, 256, (3, 3))]
        turning, still = f"turn {number}#.webp", f"still {number}?.webp"
        (folder / turning).write_bytes(webp_animation(frames))
        (folder / still).write_bytes(webp(frames[0]))
        caption = HOSTILE[number % len(HOSTILE)]
        files = {} if one.result is None else {"turntable.webp": turning, "poster.webp": still}
        objects.append(Entry(one.variant, caption, number, one.result, one.error, files, history))
    path = folder / "report.html"
    path.write_text(render_report(replace(report(), entries=tuple(objects))), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def shown(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    browser = Browser(tmp_path_factory.mktemp("profile"))
    browser.open(page)
    yield browser
    browser.close()


@pytest.fixture(autouse=True)
def peace(shown: Browser, page: Path) -> Iterator[None]:
    """Whatever a test does, nothing complains and nothing from outside of the folder is asked for."""
    yield
    assert shown.complaints == []
    folder = page.parent.as_uri()
    assert shown.requests and [address for address in shown.requests if not address.startswith((folder, "data:,"))] == []


def test_every_picture_loads_once_it_is_in_view(shown: Browser) -> None:
    shown.evaluate("document.querySelector('#objects').scrollIntoView()")
    shown.wait("[...document.images].length === 8 && [...document.images].every(image => image.complete && image.naturalWidth === 16)")


def test_sorting_orders_rows_and_says_so(shown: Browser) -> None:
    head = "document.querySelector('table.results th[data-column=\"3\"]')"
    assert shown.evaluate(f"{head}.textContent") == "Field"
    shown.evaluate(f"{head}.querySelector('button').click()")
    assert shown.evaluate(f"{head}.ariaSort") == "descending"
    assert shown.evaluate(COLUMN.format(0)) == ["ours", "none", "oracle"]
    shown.evaluate(f"{head}.querySelector('button').click()")
    assert shown.evaluate(COLUMN.format(0)) == ["none", "ours", "oracle"], "what is missing stays last"


def test_sorting_works_by_keyboard(shown: Browser) -> None:
    shown.evaluate("document.querySelector('table.results th button').focus()")
    shown.press("Enter", text="\r")
    assert shown.evaluate(COLUMN.format(0)) == ["none", "oracle", "ours"]
    shown.press("Enter", text="\r")
    assert shown.evaluate(COLUMN.format(0)) == ["ours", "oracle", "none"]


def test_filters_leave_what_fits(shown: Browser) -> None:
    def left(**asked: str) -> list[int]:
        for name in ("find", "variant", "state"):
            box, value = f"document.getElementById('{name}')", json.dumps(asked.get(name, ""))
            shown.evaluate(f"{box}.value = {value}; {box}.dispatchEvent(new Event('input'))")
        seeds = "[...document.querySelectorAll('#objects > li')].map(card => Number(card.dataset.text.split('seed ').pop()))"
        found = shown.evaluate(seeds)
        assert shown.evaluate("document.getElementById('count').textContent") == f"{len(found)} of 10 objects"
        return found

    assert left(variant="ours") == [3, 4, 8, 9]
    assert left(state="failed") == [2, 7]
    assert left(find="SEED snail ours") == [3, 9]
    assert left(find="<script>alert(1)") == [0, 6]
    assert left(find="أفوكادو", state="right") == [8]
    assert left() == list(range(10))


def test_a_pressed_picture_turns_and_all_in_view_can(shown: Browser) -> None:
    shown.evaluate("document.querySelector('#objects').scrollIntoView()")
    button = "document.querySelector('button.picture')"
    shown.evaluate(f"{button}.focus()")
    shown.press(" ", text=" ")
    assert shown.evaluate(f"[{button}.ariaPressed, decodeURIComponent({button}.firstChild.src).split('/').pop()]") == [
        "true",
        "turn 0#.webp",
    ]
    shown.press(" ", text=" ")
    assert "still" in shown.evaluate(f"{button}.firstChild.src")
    shown.evaluate("document.getElementById('turn-all').click()")
    shown.wait(f"{button}.firstChild.src.includes('turn')")
    shown.evaluate("document.getElementById('turn-all').click()")
    shown.wait("[...document.images].every(image => image.src.includes('still'))")


def test_a_card_unfolds_its_curves_and_ranks(shown: Browser) -> None:
    held = "document.querySelector('#objects details')"
    assert shown.evaluate(f"{held}.querySelectorAll('svg, table').length") == 0
    shown.evaluate(f"{held}.open = true")
    shown.wait(f"{held}.querySelectorAll('svg').length === 2")
    assert "4 of 153" in shown.evaluate(f"{held}.querySelector('table').textContent")


def test_no_caption_ran_and_directions_are_kept(shown: Browser) -> None:
    assert shown.evaluate("document.scripts.length") == 1
    captions = shown.evaluate("[...document.querySelectorAll('.caption')].map(caption => caption.textContent)")
    assert captions == [HOSTILE[number % len(HOSTILE)] for number in range(10)]
    assert shown.evaluate("getComputedStyle(document.querySelectorAll('.caption')[8]).direction") == "rtl"
    assert shown.evaluate("getComputedStyle(document.querySelectorAll('.caption')[0]).direction") == "ltr"


@pytest.mark.parametrize("width", [1280, 390, 320])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_its_window_and_can_be_read(shown: Browser, width: int, scheme: str) -> None:
    shown.resize(width, 800)
    shown.prefer(scheme)
    assert shown.evaluate("document.documentElement.scrollWidth") <= width
    ink, paper = (luminance(shown.evaluate(f"getComputedStyle(document.body).{name}")) for name in ("color", "backgroundColor"))
    quiet = luminance(shown.evaluate("getComputedStyle(document.querySelector('.quiet')).color"))
    assert (ink < paper) == (scheme == "light")
    assert contrast(ink, paper) > 7 and contrast(quiet, paper) > 4.5


def luminance(color: str) -> float:
    """Relative luminance of "rgb(r, g, b)" (WCAG 2.2)."""
    shares = [int(part) / 255 for part in color.removeprefix("rgb(").removesuffix(")").split(",")]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: float, other: float) -> float:
    """Contrast of two luminances (WCAG 2.2)."""
    return (max(one, other) + 0.05) / (min(one, other) + 0.05)

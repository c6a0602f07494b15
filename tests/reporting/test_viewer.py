"""The page that shows an object in 3D: what is in it, and what Chromium makes of it."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dreamfields_core.meshing import to_glb
from dreamfields_core.rendering.pictures import webp_animation
from dreamfields_core.reporting.viewer import object_page
from dreamfields_core.types import Mesh, Texture
from tests.meshing.textured import globe, painted_globe
from tests.reporting.browser import CHROMIUM, FLAGS, SOFTWARE_GL, Browser

HOSTILE = "</title></script><script>alert('x')</script>\"'&<img src=x onerror=alert(1)>"
LOOKED = "document.getElementById('stage').className !== 'waiting'"


class Elements(HTMLParser):
    """Tags with their attributes, and all text outside of scripts and styles."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1][0] not in ("script", "style"):
            self.text += data


def test_the_page_holds_the_very_bytes_of_the_mesh() -> None:
    glb = to_glb(globe(4), {})
    found = re.search(r'<script id="glb" type="text/plain">([^<]*)</script>', object_page(glb, caption="a globe", facts={}))
    assert found and base64.b64decode(found[1]) == glb


def test_whatever_the_caption_it_stays_text() -> None:
    page = object_page(b"", caption=HOSTILE, facts={HOSTILE: HOSTILE}, files=["a b#?.glb", HOSTILE], still=HOSTILE)
    elements = Elements(page)
    assert [tag for tag, _ in elements.tags].count("script") == 2
    assert not [name for _, attributes in elements.tags for name in attributes if name.startswith("on")]
    assert elements.text.count(HOSTILE) == 5  # title, heading, name and value of the fact, file
    addresses = [attributes.get(name) or "" for _, attributes in elements.tags for name in ("href", "src") if name in attributes]
    assert all(re.fullmatch(r"data:,|\./[\w.%/~-]+", address) for address in addresses) and "./a%20b%23%3F.glb" in addresses


def test_nothing_is_asked_of_a_network() -> None:
    page = object_page(to_glb(globe(4), {}), caption="a globe", facts={}, files=["mesh.glb"], still="turntable.webp")
    assert not re.search(r"https?:|//[a-z]|\bfetch\(|XMLHttpRequest|import\(", page)
    policies = [attributes["content"] for _, attributes in Elements(page).tags if attributes.get("http-equiv") == "Content-Security-Policy"]
    assert len(policies) == 1 and "default-src 'none'" in str(policies[0])


chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium, found none on the path (on Debian: apt-get install chromium)")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    shown = Browser(tmp_path_factory.mktemp("profile"), width=640, height=640, flags=SOFTWARE_GL)
    yield shown
    shown.close()


@pytest.fixture
def picture(browser: Browser, tmp_path: Path) -> Callable[[Mesh], np.ndarray]:
    """A mesh as the page draws it, unlit: RGBA [H, W, 4]."""

    def draw(mesh: Mesh, mode: int = 1) -> np.ndarray:
        path = tmp_path / "view #1.html"
        path.write_text(object_page(to_glb(mesh, {}), caption=HOSTILE, facts={}), encoding="utf-8")
        browser.requests.clear()
        browser.open(path)
        browser.wait(LOOKED)
        assert browser.evaluate("document.getElementById('stage').className") == "live"
        browser.evaluate(f"document.querySelector('button[data-mode=\"{mode}\"]').click(); document.getElementById('reset').click()")
        browser.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        data = browser.evaluate("document.getElementById('object').toDataURL('image/png')").partition(",")[2]
        assert browser.complaints == []
        assert all(address.startswith((tmp_path.as_uri(), "data:")) for address in browser.requests)
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA"))

    return draw


@pytest.mark.slow
@chromium
@pytest.mark.parametrize("mesh", [globe(16), painted_globe(16)], ids=["textured", "vertex colours"])
def test_it_is_drawn_the_right_way_up_in_its_own_colours(mesh: Mesh, picture: Callable[..., np.ndarray]) -> None:
    drawn = picture(mesh)
    solid = drawn[..., 3] > 250
    assert 0.1 < solid.mean() < 0.8
    rows, columns = np.nonzero(solid)
    red = drawn[rows, columns, 0].astype(float)
    # Red grows northward, from 0 to 255; what is up in the scene is up in the picture.
    assert red[rows < np.quantile(rows, 0.2)].mean() > red[rows > np.quantile(rows, 0.8)].mean() + 60
    # 0.2 and 0.8 are the only blues; were they light and not display values, they would come out as 123 and 231.
    blues = drawn[rows, columns, 2]
    near = [int((abs(blues.astype(int) - level) < 8).sum()) for level in (51, 204)]
    assert sum(near) > 0.8 * len(blues)


@pytest.mark.slow
@chromium
def test_light_shows_the_shape_and_the_normal_map(picture: Callable[..., np.ndarray]) -> None:
    mesh = globe(16)
    assert mesh.texture is not None
    bumped, smooth = picture(mesh, 2), picture(replace(mesh, texture=Texture(mesh.texture.color)), 2)
    solid = (bumped[..., 3] > 250) & (smooth[..., 3] > 250)
    assert smooth[solid][:, 0].std() > 10
    assert np.abs(bumped[solid].astype(int) - smooth[solid])[:, 0].mean() > 2


@pytest.mark.slow
@chromium
def test_keys_and_wheel_move_it(picture: Callable[..., np.ndarray], browser: Browser) -> None:
    picture(globe(8))
    shot = "document.getElementById('object').toDataURL()"
    later = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
    seen = [browser.evaluate(shot)]
    for event in ("new KeyboardEvent('keydown', {key: 'ArrowLeft'})", "new WheelEvent('wheel', {deltaY: -300})"):
        browser.evaluate(f"document.getElementById('object').dispatchEvent({event})")
        browser.evaluate(later)
        seen.append(browser.evaluate(shot))
    browser.evaluate("document.getElementById('reset').click()")
    browser.evaluate(later)
    assert len(set(seen)) == 3 and browser.evaluate(shot) == seen[0]


@pytest.mark.slow
@chromium
def test_without_webgl_the_turntable_is_shown(tmp_path: Path) -> None:
    (tmp_path / "turntable.webp").write_bytes(webp_animation([np.full((32, 48, 3), shade, np.uint8) for shade in (0, 255)]))
    page = tmp_path / "view.html"
    page.write_text(object_page(to_glb(globe(4), {}), caption="a globe", facts={}, still="turntable.webp"), encoding="utf-8")
    blind = Browser(tmp_path / "profile", flags=(*FLAGS, "--disable-3d-apis"))
    try:
        blind.open(page)
        blind.wait(LOOKED)
        blind.wait("document.querySelector('#still img').naturalWidth === 48")
        assert blind.evaluate("document.getElementById('why').textContent") == "no WebGL 2"
        assert blind.evaluate("getComputedStyle(document.getElementById('object')).display") == "none"
        assert blind.complaints == []
    finally:
        blind.close()

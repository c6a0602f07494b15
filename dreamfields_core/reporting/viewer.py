"""One page that shows an object in 3D from a folder, without a network: its binary glTF is within the page.

Where there is no WebGL, or no script, the turntable beside the page is shown instead.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from urllib.parse import quote

from dreamfields_core.reporting.markup import Markup, element, join
from dreamfields_core.reporting.style import STYLE
from dreamfields_core.reporting.viewer_script import SCRIPT

LOOK = """
#stage { position: relative; margin: 1rem 0; border: 1px solid var(--line); border-radius: .5rem; overflow: hidden;
  background: radial-gradient(circle at 50% 40%, #e9e6df, #b9b4a9); }
#object { display: none; width: 100%; height: min(72vh, 50rem); touch-action: none; cursor: grab; }
#object:active { cursor: grabbing; }
#still { display: block; margin: 0 auto; padding: 1rem; text-align: center; color: #1f1e1b; } #still img { max-width: 100%; }
#still p { margin: .5rem auto; } .still ~ .hint { display: none; }
.live #object { display: block; } .live #still, .waiting .tools, .still .tools { display: none; }
.tools { position: absolute; left: .75rem; bottom: .75rem; display: flex; gap: .4rem; }
.tools button { font: inherit; font-size: .9rem; padding: .25rem .7rem; border: 1px solid #1f1e1b40; border-radius: 1rem; cursor: pointer;
  background: #ffffffcc; color: #1f1e1b; }
.tools button[aria-pressed="true"] { background: #1f1e1b; color: #fff; }
.files { display: flex; flex-wrap: wrap; gap: .3rem 1.2rem; padding: 0; list-style: none; }
"""
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src 'self' file: data:; media-src 'self' file:"
"""What the browser itself holds the page to: nothing is asked of a network."""


def object_page(
    glb: bytes, *, caption: str, facts: Mapping[str, str | int | float], files: Sequence[str] = (), still: str | None = None
) -> str:
    """The page, as HTML text.

    glb: as `to_glb` writes it. facts: shown below, by name. files: names beside the page that can be downloaded.
    still: name of a picture beside the page for those who cannot see it turn.
    """
    head = (
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("link", rel="icon", href="data:,"),
        element("title", caption),
        element("style", Markup(STYLE + LOOK)),
    )
    body = (
        element("h1", caption),
        _stage(caption, still),
        element("p", "Drag to turn, scroll or pinch to come near, arrow keys, + and -.", class_="quiet hint"),
        element("dl", *(element("div", element("dt", name), element("dd", value)) for name, value in facts.items()), class_="facts"),
        element("ul", *(element("li", element("a", name, href=_address(name), download=name)) for name in files), class_="files"),
        element("script", Markup(base64.b64encode(glb).decode()), id="glb", type="text/plain"),
        element("script", Markup(SCRIPT)),
    )
    return f"<!doctype html>\n{element('html', element('head', *head), element('body', *body), lang='en')}\n"


def _stage(caption: str, still: str | None) -> Markup:
    modes = ("Lit", "Colour", "Shape")
    buttons = [
        element("button", name, type="button", data_mode=mode, aria_pressed="true" if mode == 0 else "false")
        for mode, name in enumerate(modes)
    ]
    picture = element("img", src=_address(still), alt=f"{caption}, turning", loading="lazy") if still else "No picture is beside this page."
    excuse = element("p", "The object cannot be shown in 3D here: ", element("span", "no script is run", id="why"))
    return element(
        "div",
        element("canvas", id="object", tabindex=0, role="img", aria_label=f"{caption}, in 3D"),
        element("div", picture, excuse, id="still"),
        element("div", join(buttons), element("button", "Reset", type="button", id="reset"), class_="tools"),
        id="stage",
        class_="waiting",
    )


def _address(name: str) -> str:
    """A file name as an address relative to the page."""
    return "./" + quote(name)

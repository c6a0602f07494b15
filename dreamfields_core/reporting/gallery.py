"""The objects as cards: turntable, caption, what the judge says, files, and what can be asked of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import quote

from dreamfields_core.reporting.contract import POOLS, SOURCES, Entry
from dreamfields_core.reporting.curves import QUANTITIES, single
from dreamfields_core.reporting.markup import Content, Markup, element, join
from dreamfields_core.reporting.plots import extent, plot
from dreamfields_core.reporting.statistics import retrieval

LINKS = {
    "view.html": "View in 3D",
    "mesh.glb": "Mesh",
    "turntable.mp4": "Film",
    "contact_sheet.png": "Contact sheet",
    "result.json": "All facts",
}
"""Files that a card leads to, by the names that a dream gives them."""
STATES = {"right": "recognised", "wrong": "not recognised", "unjudged": "not judged", "failed": "failed"}
SIDE = 256
"""Pixels of a picture on the page."""


def gallery(entries: Sequence[Entry], judges: Sequence[str]) -> Markup:
    """The form that filters, and a card for each object."""
    meshed = bool(judges) and any(retrieval(entry, judges[0], "random", "mesh") for entry in entries)
    seen = "the field and the mesh" if meshed else "the field"
    said = f"Beneath each: the place that {judges[0]} gives the true caption, seeing {seen}." if judges else None
    return join(
        [
            element("p", said, class_="quiet"),
            _form(entries, judges),
            element("ul", *(card(entry, judges) for entry in entries), class_="gallery", id="objects"),
        ]
    )


def state(entry: Entry, judges: Sequence[str]) -> str:
    """One of STATES: whether the first judge picks the caption, seeing the field."""
    if entry.result is None:
        return "failed"
    said = retrieval(entry, judges[0], "random", "field") if judges else None
    return "unjudged" if said is None else "right" if said["correct"] else "wrong"


def card(entry: Entry, judges: Sequence[str]) -> Markup:
    """One object, or the sentence that says why there is none."""
    return element(
        "li",
        _picture(entry),
        element("p", entry.caption, class_="caption", dir="auto"),
        element("p", element("bdi", entry.variant), f" · seed {entry.seed}", class_="quiet"),
        _verdict(entry, judges),
        _links(entry),
        _more(entry, judges),
        class_="card",
        data_variant=entry.variant,
        data_state=state(entry, judges),
        data_text=f"{entry.caption} {entry.variant} seed {entry.seed}".lower(),
    )


def _form(entries: Sequence[Entry], judges: Sequence[str]) -> Markup:
    variants = list(dict.fromkeys(entry.variant for entry in entries))
    present = {state(entry, judges) for entry in entries}
    states = [(key, name) for key, name in STATES.items() if key in present]
    return element(
        "form",
        element("label", "Find ", element("input", type="search", id="find", placeholder="caption, variant or seed", autocomplete="off")),
        element("label", "Variant ", _select("variant", [(variant, variant) for variant in variants])),
        element("label", "Judged ", _select("state", states)),
        element("label", element("input", type="checkbox", id="turn-all"), " Turn those in view"),
        element("output", f"{len(entries)} of {len(entries)} objects", id="count", for_="find variant state"),
        role="search",
        class_="filter scripted-only",
    )


def _select(name: str, options: Sequence[tuple[str, str]]) -> Markup:
    return element("select", element("option", "all", value=""), *(element("option", text, value=key) for key, text in options), id=name)


def _picture(entry: Entry) -> Markup:
    still = entry.files.get("poster.webp") or entry.files.get("turntable.webp")
    turning = entry.files.get("turntable.webp")
    if not still:
        return element("div", "no picture", class_="picture empty")
    image = element(
        "img",
        src=quote(still),
        alt=f"The object dreamed from: {entry.caption}",
        width=SIDE,
        height=SIDE,
        loading="lazy",
        decoding="async",
        data_still=quote(still),
        data_turn=quote(turning) if turning else None,
    )
    if not turning:
        return element("div", image, class_="picture")
    return element("button", image, type="button", class_="picture", aria_pressed="false", title="Turn")


def _verdict(entry: Entry, judges: Sequence[str]) -> Markup:
    if entry.result is None:
        return element("p", "Failed: ", element("bdi", entry.error or "no reason was recorded"), class_="bad")
    said = {source: retrieval(entry, judges[0], "random", source) if judges else None for source in SOURCES}
    if said["field"] is None:
        return element("p", "not judged", class_="quiet")
    parts: list[Content] = []
    for source, found in said.items():
        if found:
            shown = f"{source} {found['rank']}/{found['pool']}{' ✓' if found['correct'] else ''}"
            parts += [" · " if parts else None, element("span", shown, class_="right" if found["correct"] else None)]
    return element("p", *parts, class_="verdict")


def _links(entry: Entry) -> Markup | None:
    links = [
        element("a", text, href=quote(entry.files[name]), aria_label=f"{text}: {entry.caption}")
        for name, text in LINKS.items()
        if name in entry.files
    ]
    return element("p", *links, class_="links") if links else None


def _more(entry: Entry, judges: Sequence[str]) -> Markup | None:
    parts: list[Content] = []
    for quantity, name in QUANTITIES.items():
        curve = single(entry.history, quantity) if entry.history else None
        if curve:
            values = (0.0, 1.0) if quantity == "correct" else extent([curve])
            parts.append(element("figure", element("figcaption", name), plot(curve, name, values=values, height=90)))
    ranks = [
        element(
            "tr",
            element("th", judge, scope="row"),
            element("td", f"{source}, {pool}"),
            element("td", f"{said['rank']} of {said['pool']}"),
            element("td", f"{said['similarity']:.3f}"),
        )
        for judge in judges
        for source in SOURCES
        for pool in POOLS
        if (said := retrieval(entry, judge, pool, source))
    ]
    if ranks:
        heads = (element("th", name, scope="col") for name in ("Judge", "Pictures of, pool", "Rank", "Cosine"))
        parts.append(element("table", element("thead", element("tr", *heads)), element("tbody", *ranks)))
    if seconds := (entry.result or {}).get("seconds"):
        parts.append(element("p", f"{sum(seconds.values()):,.0f} s in all", class_="quiet"))
    # In a template they cost nothing until somebody asks: hiding a thousand cards with their curves took seconds.
    return (
        element("details", element("summary", "Curves and ranks"), element("template", *parts), class_="scripted-only") if parts else None
    )

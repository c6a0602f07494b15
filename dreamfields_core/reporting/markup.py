"""HTML and SVG as values: whatever is not markup already is escaped, so that no caption can become a tag.

Only `element` and `escape` make Markup of what came from outside; Markup itself is for constants.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable

VOID = {"img", "input", "link", "meta", "br"}
"""Elements that have no end."""

_UNFIT = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""No document may hold these: control characters, halves of surrogate pairs, non-characters."""


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


Content = str | int | float | None
"""Markup as it is, other text and numbers escaped, None as nothing."""
Attribute = str | int | float | bool | None
"""True is the bare name; False and None leave the attribute out."""


def escape(text: str | int | float) -> Markup:
    """Text for an element's content or a quoted attribute. What no document may hold becomes U+FFFD."""
    return Markup(html.escape(_UNFIT.sub("\N{REPLACEMENT CHARACTER}", str(text)), quote=True))


def markup(content: Content) -> Markup:
    """The content, escaped unless it is markup."""
    if isinstance(content, Markup):
        return content
    return Markup() if content is None else escape(content)


def join(contents: Iterable[Content]) -> Markup:
    """One after the other."""
    return Markup("".join(map(markup, contents)))


def element(name: str, /, *contents: Content, **attributes: Attribute) -> Markup:
    """`<name ...>contents</name>`. In names of attributes a final underscore is dropped (class_), others become hyphens (aria_label)."""
    told = "".join(_attribute(key.rstrip("_").replace("_", "-"), value) for key, value in attributes.items())
    end = "" if name in VOID else f"</{name}>"
    return Markup(f"<{name}{told}>{join(contents)}{end}")


def _attribute(name: str, value: Attribute) -> str:
    if value is None or value is False:
        return ""
    return f" {name}" if value is True else f' {name}="{escape(value)}"'

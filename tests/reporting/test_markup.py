"""Whatever comes from outside is text: read back by a parser, it is what was written, and no tag more."""

from __future__ import annotations

from html.parser import HTMLParser

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.reporting.markup import Markup, element, escape, join


class Reader(HTMLParser):
    """The tags, attributes and text of a document."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict]] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data


TEXTS = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cn", "Co"]), max_size=40)


@settings(max_examples=200)
@given(text=TEXTS, attribute=TEXTS)
def test_text_comes_back_as_it_went_in(text: str, attribute: str) -> None:
    read = Reader(element("p", text, title=attribute))
    assert read.tags == [("p", {"title": attribute})] and read.text == text


@pytest.mark.parametrize(
    "text", ["<script>alert(1)</script>", "</p><img src=x onerror=alert(1)>", "\" onload='x' `", "&lt;b&gt; & &amp;", "<!--"]
)
def test_no_text_becomes_a_tag(text: str) -> None:
    read = Reader(element("p", text, data_text=text))
    assert read.tags == [("p", {"data-text": text})] and read.text == text


@pytest.mark.parametrize("unfit", ["\x00", "\x1b", "\x85", "\ud800", "\uffff"])
def test_what_no_document_may_hold_is_replaced(unfit: str) -> None:
    assert escape(f"a{unfit}b") == "a\ufffdb"
    assert escape("a\tb\nc").encode() == b"a\tb\nc"


def test_markup_is_not_escaped_twice() -> None:
    inner = element("b", "1 < 2")
    assert element("p", inner, 3, None) == "<p><b>1 &lt; 2</b>3</p>"
    assert join([inner, "<"]) == "<b>1 &lt; 2</b>&lt;"
    assert isinstance(inner, Markup)


def test_attributes_are_named_as_in_html_and_left_out_where_there_is_nothing() -> None:
    made = element("input", type="checkbox", class_="a", aria_label="b", hidden=True, disabled=False, title=None, tabindex=0)
    assert made == '<input type="checkbox" class="a" aria-label="b" hidden tabindex="0">'

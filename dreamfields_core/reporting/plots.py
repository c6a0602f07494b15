"""Curves and dots as inline SVG: no script, no library, colours from the page's style."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from dreamfields_core.reporting.curves import Band
from dreamfields_core.reporting.markup import Content, Markup, element, join

LEFT, RIGHT, TOP, BOTTOM = 34.0, 8.0, 8.0, 18.0
"""Room around the curve for the numbers, in units of the drawing."""


@dataclass(frozen=True)
class Scale:
    """From values in [low, high] to positions in [start, end]."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        share = (value - self.low) / (self.high - self.low) if self.high > self.low else 0.5
        return self.start + share * (self.end - self.start)


def extent(bands: Iterable[Band]) -> tuple[float, float]:
    """The range of all means and errors, a little widened; what plots to be compared share."""
    ends = [mean + sign * error for band in bands for mean, error in zip(band.means, band.errors) for sign in (-1, 1)]
    low, high = min(ends), max(ends)
    margin = 0.04 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin


def plot(band: Band, title: str, *, values: tuple[float, float], width: int = 240, height: int = 120) -> Markup:
    """One curve with its band, axes that say their ends and middle, and a title for those who hear the page."""
    across = Scale(0.0, band.steps[-1], LEFT, width - RIGHT)
    up = Scale(*values, height - BOTTOM, TOP)
    ticks = [_tick(value, up(value), width) for value in round_values(*values)]
    ends = [
        element("text", "0", x=_fixed(LEFT), y=height - 4, class_="tick"),
        element("text", f"{band.steps[-1]:,.0f} steps", x=_fixed(width - RIGHT), y=height - 4, class_="tick end"),
    ]
    points = [(across(step), up(mean)) for step, mean in zip(band.steps, band.means)]
    drawn: list[Content] = [element("title", title), *ticks, *ends]
    if any(band.errors):
        above = [(across(step), up(mean + error)) for step, mean, error in zip(band.steps, band.means, band.errors)]
        below = [(across(step), up(mean - error)) for step, mean, error in zip(band.steps, band.means, band.errors)]
        drawn.append(element("polygon", points=_path(above + below[::-1]), class_="band"))
    drawn.append(element("polyline", points=_path(points), class_="curve"))
    if len(points) <= 12:  # measured now and then: show where
        drawn += [element("circle", cx=_fixed(x), cy=_fixed(y), r="2.5", class_="dot") for x, y in points]
    return element("svg", *drawn, viewBox=f"0 0 {width} {height}", role="img", aria_label=title, class_="plot")


def dots(ours: Sequence[tuple[float, float, str]], *, width: int = 132, height: int = 22) -> Markup:
    """Shares in [0, 1] with their errors as dots on one line; each is (share, error or NaN, class)."""
    across = Scale(0.0, 1.0, 5.0, width - 5.0)
    y = height / 2
    lines = [element("line", x1=_fixed(across(x)), x2=_fixed(across(x)), y1="3", y2=height - 3, class_="grid") for x in (0, 0.5, 1)]
    marks = []
    for share, error, kind in ours:
        if math.isfinite(error):
            begin, end = (across(min(1.0, max(0.0, share + sign * error))) for sign in (-1, 1))
            marks.append(element("line", x1=_fixed(begin), x2=_fixed(end), y1=_fixed(y), y2=_fixed(y), class_=f"whisker {kind}"))
        marks.append(element("circle", cx=_fixed(across(share)), cy=_fixed(y), r="3.5", class_=f"dot {kind}"))
    return element("svg", *lines, *marks, viewBox=f"0 0 {width} {height}", width=width, height=height, aria_hidden="true", class_="dots")


def round_values(low: float, high: float) -> list[float]:
    """Two to five round numbers within [low, high]."""
    rough = (high - low) / 3
    unit = 10.0 ** math.floor(math.log10(rough))
    step = next(unit * factor for factor in (1, 2, 5, 10) if unit * factor >= rough)
    return [number * step for number in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def _tick(value: float, y: float, width: int) -> Markup:
    return join(
        [
            element("line", x1=_fixed(LEFT), x2=_fixed(width - RIGHT), y1=_fixed(y), y2=_fixed(y), class_="grid"),
            element("text", f"{value:.6g}".replace("-", "−"), x=_fixed(LEFT - 4), y=_fixed(y + 3), class_="tick end"),
        ]
    )


def _path(points: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{_fixed(x)},{_fixed(y)}" for x, y in points)


def _fixed(value: float) -> str:
    """One decimal: a tenth of a pixel, and the same text everywhere."""
    return f"{value:.1f}"

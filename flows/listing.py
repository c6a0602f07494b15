"""Lists for the terminal: every setting as a line that `--set` takes back, and the image-text models."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dreamfields_core.config import DreamConfig


def lines(config: DreamConfig) -> Iterator[str]:
    """`part.key=value`, one a setting."""
    yield from _lines("", config.model_dump(mode="json"))


def _lines(prefix: str, value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _lines(f"{prefix}.{name}" if prefix else name, inner)
    else:
        yield f"{prefix}={value if isinstance(value, str) else json.dumps(value)}"


def models(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A table of image-text models: name, size, side of their pictures, licence, whether on disk, what it is."""
    header = ("name", "MB", "pixels", "licence", "on disk", "about")
    cells = [
        (row["name"], str(row["megabytes"]), str(row["image_size"]), row["licence"], "yes" if row["on_disk"] else "no", row["about"])
        for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(header, *cells)]
    for name, size, pixels, *rest in (header, *cells):
        texts = [text.ljust(width) for text, width in zip(rest, widths[3:])]
        yield "  ".join([name.ljust(widths[0]), size.rjust(widths[1]), pixels.rjust(widths[2]), *texts]).rstrip()

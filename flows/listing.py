"""Every setting as a line that `--set` takes back."""

from __future__ import annotations

import json
from collections.abc import Iterator
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

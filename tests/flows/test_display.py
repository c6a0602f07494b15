"""What a terminal, and a file in its place, are told of the mesh while its field is asked."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from flows import display
from flows.display import Display


def shown(*, terminal: bool) -> str:
    """The points of three batches, and the step's end."""
    file = io.StringIO()
    with Display(Console(file=file, force_terminal=terminal, width=100, highlight=False), steps=10) as told:
        for points in (32768, 65536, 1234567):
            told({"event": "asked", "points": points})
        told({"event": "end", "name": "mesh", "cached": False, "seconds": 2.0})
        told({"event": "asked", "points": 5})  # of another mesh: its bar is a new one
    return file.getvalue()


def test_a_terminal_has_a_bar_with_the_points_asked() -> None:
    text = shown(terminal=True)
    assert "mesh" in text and "points asked" in text and "mesh: 2.0 s" in text


def test_a_file_gets_a_line_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(terminal=False).splitlines() == ["mesh: 2.0 s"]
    monkeypatch.setattr(display, "SECONDS", 0.0)
    assert shown(terminal=False).splitlines()[:3] == [f"mesh: {points} points asked" for points in ("32,768", "65,536", "1,234,567")]


def test_a_step_counts_as_saved_only_when_it_is() -> None:
    with Display(Console(file=io.StringIO()), steps=10) as told:
        for step in range(1, 6):
            told({"event": "step", "step": step, "loss": 0.0, "transmittance": 0.9})
        assert (told.step, told.saved) == (5, 0)
        told({"event": "saved", "step": 4})
        assert told.saved == 4
        told({"event": "stopped", "step": None})
        assert told.saved == 4
        told({"event": "stopped", "step": 5})
        assert told.saved == 5

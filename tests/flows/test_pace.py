"""Often enough to follow, seldom enough to read."""

from __future__ import annotations

import pytest

from flows.pace import Pace


def says(pace: Pace, monkeypatch: pytest.MonkeyPatch, now: float, *, anyway: bool = False) -> bool:
    monkeypatch.setattr("time.monotonic", lambda: now)
    return pace.is_due(anyway=anyway)


def test_it_is_due_at_once_and_then_once_in_so_many_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("time.monotonic", lambda: 100.0)
    pace = Pace(2.0)
    assert [says(pace, monkeypatch, now) for now in (100.0, 101.9, 102.0, 103.5, 104.5)] == [True, False, True, False, True]


def test_it_may_wait_for_the_first_time_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("time.monotonic", lambda: 100.0)
    pace = Pace(2.0, at_once=False)
    assert [says(pace, monkeypatch, now) for now in (100.0, 101.9, 102.0)] == [False, False, True]


def test_what_must_be_told_is_told_and_the_seconds_begin_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("time.monotonic", lambda: 100.0)
    pace = Pace(2.0)
    assert says(pace, monkeypatch, 100.5)
    assert says(pace, monkeypatch, 101.0, anyway=True)
    assert not says(pace, monkeypatch, 102.9) and says(pace, monkeypatch, 103.0)

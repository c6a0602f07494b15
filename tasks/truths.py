"""The step that no dream has: true pictures under the judge's eyes. Its code is loaded when it is really run."""

from __future__ import annotations

from tasks.step import Step
from tasks.steps import CAMERAS, JUDGE, Later

ORACLE = Step("oracle", 1, (*CAMERAS, *JUDGE), Later("tasks.oracle:oracle"))
"""caption, judge (digest), picture where one was given -> poster.webp; values: for each pool, what the judge retrieves from the truth."""

"""Plots of results: log axes, one look."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes


@contextmanager
def sheet(path: Path, *, panels: int = 1, rows: int = 1) -> Iterator[list[Axes]]:
    """So many panels side by side, in so many rows, one list of all; saved as `path` in the end."""
    figure, axes = plt.subplots(rows, panels, figsize=(5.0 * panels, 4.0 * rows), squeeze=False, layout="constrained")
    try:
        yield list(axes.ravel())
        for panel in axes.ravel():
            if panel.get_xscale() == "log":  # few labels between the powers of ten: they would run into each other
                panel.xaxis.set_minor_formatter(lambda value, position: f"{value:g}" if f"{value:e}"[0] in "25" else "")
            panel.grid(alpha=0.25, which="both", linewidth=0.5)
            if panel.get_legend_handles_labels()[0]:
                panel.legend(fontsize=8, frameon=False)
        figure.savefig(path, dpi=110)
    finally:
        plt.close(figure)

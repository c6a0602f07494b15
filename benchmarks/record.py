"""What a benchmark leaves: benchmarks/results/NAME.json with the machine, the command and the spread, and a plot NAME.png beside it."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).resolve().parent / "results"
LIBRARIES = ("jax", "jaxlib", "flax", "optax", "numpy", "zarr")

Result = dict[str, Any]


def machine() -> Result:
    """Processor, cores, memory, devices and versions that a figure depends on; the load says how busy it was otherwise."""
    import jax

    return {
        "processor": _processor(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "devices": sorted({device.device_kind for device in jax.devices()}),
        "system": platform.system(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in LIBRARIES},
        "load_per_core": round(os.getloadavg()[0] / (os.cpu_count() or 1), 2),
    }


def spread(values: Sequence[float]) -> Result:
    """Median, quartiles and how many."""
    low, middle, high = np.quantile(np.asarray(values, np.float64), [0.25, 0.5, 0.75])
    return {"median": _short(middle), "low": _short(low), "high": _short(high), "count": len(values)}


def leave(name: str, result: Result, *, command: str, folder: Path = RESULTS) -> Path:
    """Write the result with the facts of this run; the path of the JSON.

    Raises:
      ValueError: there is no `headline`, or a number in it is not finite (None says that it was not measured).
    """
    headline = result.get("headline")
    if not headline:
        raise ValueError(f"expected a result with a headline, got {sorted(result)}: say what it shows in one object")
    for key, value in headline.items():
        if value is not None and not np.isfinite(value):
            raise ValueError(f"expected a finite {key} in the headline, got {value}: measure again, or say None")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    whole = {"name": name, "command": command, "machine": machine(), **result}
    path.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    return path


def _processor() -> str:
    """The model's name where the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.processor())


def _short(value: float) -> float:
    return float(f"{value:.5g}")

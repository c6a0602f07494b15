"""Compiled programs kept between runs, so that the second start takes seconds."""

from __future__ import annotations

import os
import sys
from pathlib import Path

VARIABLE = "DREAMFIELDS_CACHE"


def cache_folder() -> Path:
    """Where this user's caches of ours lie: $DREAMFIELDS_CACHE, else the place the system has for such things."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return Path(chosen)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "dreamfields"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dreamfields"


def keep_compiled() -> None:
    """Tell JAX where to keep compiled programs, unless the user has; through the environment, which JAX reads when it is imported."""
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(cache_folder() / "compiled"))
    # The many small programs too: together they cost a warm start more than the large ones.
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")

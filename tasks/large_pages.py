"""Large pages for the arrays of a process that is about to start.

XLA asks for a step's temporary memory anew each time and gives it back after; on Linux every four kilobytes of it are then a page
fault, which for the small steps of a draft is a quarter of their time. glibc from 2.35 on can ask for pages of megabytes instead,
if it is told so before the process starts; elsewhere nothing reads the variable.
"""

from __future__ import annotations

from collections.abc import Mapping

VARIABLE = "GLIBC_TUNABLES"
NAME = "glibc.malloc.hugetlb"


def with_large_pages(environment: Mapping[str, str]) -> dict[str, str]:
    """The environment with large pages asked for, unless it says something of them already; other tunables stay."""
    told = environment.get(VARIABLE, "")
    if any(setting.startswith(f"{NAME}=") for setting in told.split(":")):
        return dict(environment)
    return {**environment, VARIABLE: ":".join(filter(None, [told, f"{NAME}=1"]))}

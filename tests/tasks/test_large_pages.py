"""Large pages: what a child's environment says, and that glibc heeds it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from tasks.large_pages import VARIABLE, with_large_pages

ALLOCATE = """
import ctypes
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
place = libc.malloc(ctypes.c_size_t(2**26))
inside = False
for line in open("/proc/self/smaps"):
    if "-" in line.split()[0] and not line.startswith("VmFlags"):
        begin, end = (int(part, 16) for part in line.split()[0].split("-"))
        inside = begin <= place < end
    elif inside and line.startswith("VmFlags"):
        print(" hg " in line + " ")
"""
"""Whether a large block lies where large pages were asked for."""


def _glibc() -> tuple[int, ...]:
    name, version = platform.libc_ver()
    return tuple(int(part) for part in version.split(".")) if name == "glibc" else (0,)


def test_asked_for_beside_what_else_is_set() -> None:
    assert with_large_pages({"A": "b"}) == {"A": "b", VARIABLE: "glibc.malloc.hugetlb=1"}
    assert with_large_pages({VARIABLE: "glibc.malloc.check=1"})[VARIABLE] == "glibc.malloc.check=1:glibc.malloc.hugetlb=1"


@pytest.mark.parametrize("own", ["glibc.malloc.hugetlb=0", "glibc.malloc.check=1:glibc.malloc.hugetlb=2"])
def test_what_the_user_says_of_them_holds(own: str) -> None:
    assert with_large_pages({VARIABLE: own}) == {VARIABLE: own}


@pytest.mark.skipif(_glibc() < (2, 35), reason="glibc reads the variable from 2.35 on")
@pytest.mark.skipif(not Path("/sys/kernel/mm/transparent_hugepage/enabled").is_file(), reason="this kernel has no large pages")
@pytest.mark.parametrize(("environment", "large"), [(with_large_pages(os.environ), True), ({**os.environ, VARIABLE: ""}, False)])
def test_glibc_heeds_it(environment: dict[str, str], large: bool) -> None:
    if "[madvise]" not in Path("/sys/kernel/mm/transparent_hugepage/enabled").read_text():
        pytest.skip("this kernel gives large pages to all who ask for memory, or to none")
    done = subprocess.run([sys.executable, "-c", ALLOCATE], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(large)]

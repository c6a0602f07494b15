"""`python -m benchmarks NAME [options]`, the same as `dreamfields bench NAME`."""

from __future__ import annotations

import sys

from tasks.compiled import keep_compiled

if __name__ == "__main__":
    keep_compiled()
    from benchmarks.command import BENCHMARKS, UnknownBenchmark, bench

    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit("\n".join(f"{name:8} {about}" for name, about in BENCHMARKS.items()))
    try:
        print(bench(sys.argv[1], sys.argv[2:]))
    except UnknownBenchmark as error:
        sys.exit(str(error))

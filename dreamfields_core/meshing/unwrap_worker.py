"""The chart maker in a process of its own: npz on stdin, npz on stdout, one sentence on stderr when it fails. Run by `unwrap`.

in:  vertices [V, 3] float32, faces [F, 3] int32, size () int64, gutter () int64.
out: source [W] int32 (the vertex that each one was), faces [F, 3] int32, uv [W, 2] float32 in [0, 1].
"""

from __future__ import annotations

import io
import os
import sys

import numpy as np


def charts(vertices: np.ndarray, faces: np.ndarray, size: int, gutter: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut the surface into charts that lie flat, and pack them on one square sheet of about `size` texels, `gutter` apart."""
    import xatlas

    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices, faces.astype(np.uint32))
    packing = xatlas.PackOptions()
    packing.resolution = size
    packing.padding = gutter
    packing.blockAlign = True  # four times fewer places to try
    atlas.generate(xatlas.ChartOptions(), packing)
    source, corners, uv = atlas[0]
    # The sheet is not square, and both its sides were stretched to 1.
    sheet = np.array([atlas.width, atlas.height], np.float64)
    return source.astype(np.int32), corners.astype(np.int32), (uv * sheet / sheet.max()).astype(np.float32)


def main() -> int:
    """Exit status: 0, 3 for a library that is missing, anything else for what nobody foresaw."""
    # The library may print; what it prints must not mix with the answer.
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        vertices, faces, size, gutter = (given[name] for name in ("vertices", "faces", "size", "gutter"))
    try:
        source, corners, uv = charts(vertices, faces, int(size), int(gutter))
    except ImportError as fault:
        print(f"xatlas is not installed whole ({str(fault).splitlines()[0]}): install the project again", file=sys.stderr)
        return 3
    blob = io.BytesIO()
    np.savez(blob, allow_pickle=False, source=source, faces=corners, uv=uv)
    with answer:
        answer.write(blob.getvalue())
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)

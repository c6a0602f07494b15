"""What other programs say of our files: validators, and whether every format holds the same object when it is read again.

The readers and validators are those of the tests (tests/meshing), which are not ours.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np

from dreamfields_core.meshing import FORMATS, from_glb, provenance_of
from dreamfields_core.meshing.pieces import volume
from dreamfields_core.types import Mesh
from tests.meshing.reload import reload, write

VALIDATOR = Path(__file__).resolve().parent.parent / ".cache" / "gltf-validator"
"""Where the tests install it."""
CLOSE = 2e-6
"""World units: float32 as text."""


def gltf_findings(glb: bytes, folder: Path) -> int | None:
    """Errors, warnings, information and hints of the Khronos validator; None where it is not installed (tests/meshing/validator)."""
    if shutil.which("node") is None or not (VALIDATOR / "node_modules").is_dir():
        return None
    path = folder / "mesh.glb"
    path.write_bytes(glb)
    done = subprocess.run(["node", "check.mjs", str(path)], cwd=VALIDATOR, capture_output=True, text=True, timeout=120, check=True)
    (report,) = json.loads(done.stdout)
    return int(sum(report["issues"][f"num{severity}"] for severity in ("Errors", "Warnings", "Infos", "Hints")))


def usd_findings(glb: bytes, folder: Path) -> int:
    """What OpenUSD's own validators find in the USDZ of this mesh."""
    from pxr import Usd, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    path = write(FORMATS["usdz"](from_glb(glb), provenance_of(glb)), folder)
    return len(UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path))))


def differences(glb: bytes, folder: Path) -> int:
    """In how many of bounds, orientation and texture (where a format has some) a format differs from the mesh, over all formats."""
    mesh, told = from_glb(glb), provenance_of(glb)
    wrong = 0
    for name, writer in FORMATS.items():
        place = folder / name
        place.mkdir()
        read = reload(write(writer(mesh, told), place))
        wrong += not np.allclose(bounds(read.vertices), bounds(mesh.vertices), atol=CLOSE)
        # Signed: with the bounds it tells a mirrored object, and one inside out.
        wrong += not np.isclose(volume(Mesh(read.vertices, read.faces)), volume(mesh), rtol=1e-4)
        wrong += name in ("glb", "obj", "usdz") and (read.image is None or not np.array_equal(read.image, mesh.texture.color))  # type: ignore[union-attr]
        wrong += name == "ply" and read.paint is None
    return wrong


def bounds(vertices: np.ndarray) -> np.ndarray:
    """[2, 3] least and greatest coordinates."""
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])

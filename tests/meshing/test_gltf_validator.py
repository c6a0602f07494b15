"""The Khronos validator's word on our files: not one error, warning, information or hint.

`npm ci` fetches the validator once, as tests/meshing/validator/package-lock.json pins it; without node, npm or a registry the
tests skip, saying which is missing. On CI (the variable CI is set, as .ci/run does) a registry that does not answer is a failure.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dreamfields_core.meshing import to_glb
from dreamfields_core.types import Mesh, Texture
from tests.conftest import CACHE
from tests.meshing.textured import globe, painted_globe

pytestmark = pytest.mark.slow
SOURCES = Path(__file__).parent / "validator"
Validate = Callable[[bytes], dict[str, Any]]


@pytest.fixture(scope="module")
def validator() -> Path:
    """A folder with the script and the installed validator."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            pytest.skip(f"the glTF validator needs {program}, which this machine does not have")
    folder = CACHE / "gltf-validator"
    for source in SOURCES.iterdir():
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, folder)
    if not (folder / "node_modules" / "gltf-validator").is_dir():
        command = ["npm", "ci", "--no-audit", "--no-fund", "--ignore-scripts", "--cache", str(CACHE / "npm")]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
        if done.returncode != 0:
            (pytest.fail if os.environ.get("CI") else pytest.skip)(f"npm could not fetch the glTF validator: {done.stderr.strip()[-300:]}")
    return folder


@pytest.fixture
def validate(validator: Path, tmp_path: Path) -> Validate:
    """Bytes of a GLB -> the validator's report."""

    def ask(data: bytes) -> dict[str, Any]:
        path = tmp_path / "mesh.glb"
        path.write_bytes(data)
        done = subprocess.run(["node", "check.mjs", str(path)], cwd=validator, capture_output=True, text=True, timeout=120, check=True)
        (report,) = json.loads(done.stdout)
        return dict(report)

    return ask


MESHES: dict[str, Mesh] = {
    "vertex colours": painted_globe(),
    "bare": replace(painted_globe(), colors=None),
    "textured": replace(globe(), texture=Texture(globe().texture.color)),  # type: ignore[union-attr]
    "normal-mapped": globe(),
    "many vertices": painted_globe(182),
}


@pytest.mark.parametrize("kind", MESHES)
def test_nothing_is_found(kind: str, validate: Validate) -> None:
    report = validate(to_glb(MESHES[kind], {"caption": 'é " \\ <b>', "seed": 3, "digests": ["ab"]}))
    assert report["issues"]["messages"] == []
    assert [report["issues"][f"num{severity}"] for severity in ("Errors", "Warnings", "Infos", "Hints")] == [0, 0, 0, 0]
    assert report["info"]["totalTriangleCount"] == len(MESHES[kind].faces)
    assert report["info"]["hasTextures"] == (MESHES[kind].texture is not None)


def test_a_planted_fault_is_found(validate: Validate) -> None:
    mesh = painted_globe(4)
    broken = to_glb(mesh, {}).replace(b'"roughnessFactor":1.0', b'"roughnessFactor":7.0')
    assert validate(broken)["issues"]["numErrors"] == 1

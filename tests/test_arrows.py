"""The arrows between the rooms: flows -> tasks -> {core, storage}, and six floors inside the core, top to bottom, without a circle."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterable
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parent.parent
PACKAGES = ("flows", "tasks", "storage", "dreamfields_core")

MAY_IMPORT = {
    "flows": {"flows", "tasks", "storage", "dreamfields_core", "benchmarks"},
    "tasks": {"tasks", "storage", "dreamfields_core"},
    "storage": {"storage"},
    "dreamfields_core": {"dreamfields_core"},
}
"""Whom each package may import among ourselves."""

OUTSIDERS = {
    "storage": {"prefect", "typer", "rich", "flax", "optax", "trimesh", "pymeshlab", "PIL"},
    "dreamfields_core": {"prefect", "zarr", "obstore", "typer", "rich", "huggingface_hub", "boto3", "fsspec"},
}
"""Libraries that a package must not know: storage knows no field and no mesh, the core no path and no conductor."""

FLOORS = (
    {"teaching", "dreaming", "reporting"},
    {"rendering", "meshing"},
    {"judging", "scene", "fields"},
    {"guidance", "presets"},
    {"config"},
    {"captions", "png", "precision", "types"},
)
"""Rooms of the core, top to bottom. A room imports itself and lower floors, never its neighbour."""

LEVEL = {room: depth for depth, floor in enumerate(FLOORS) for room in floor}

Modules = dict[str, str]
"""Dotted name -> source text; a package stands under its own name."""


def read(root: Path, packages: Iterable[str]) -> Modules:
    """Every module of the packages."""
    found = {}
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text(encoding="utf-8")
    return found


def imported(name: str, source: str, modules: Modules) -> set[str]:
    """Dotted names that a module imports, wherever in it; `from room import name` is `room.name` if that is a module, else `room`."""
    is_package = any(other.startswith(f"{name}.") for other in modules)
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = name.split(".")
                above = parts[: len(parts) - node.level + is_package]
                base = ".".join([*above, base] if base else above)
            found |= {full if (full := f"{base}.{alias.name}") in modules else base for alias in node.names}
    return found - {name}


def place(name: str) -> tuple[str, str]:
    """Package and room of a dotted name; the room is "" for the package itself."""
    package, _, rest = name.partition(".")
    return package, rest.partition(".")[0]


def faults(modules: Modules) -> list[str]:
    """One sentence for every arrow that runs the wrong way."""
    arrows = {name: imported(name, source, modules) for name, source in modules.items()}
    found = []
    for name, targets in arrows.items():
        package, room = place(name)
        for target in sorted(targets):
            other, other_room = place(target)
            if other in {*MAY_IMPORT, "tests", "benchmarks"} and other not in MAY_IMPORT[package]:
                found.append(f"{name} imports {target}: {package} must not know {other}")
            elif other in OUTSIDERS.get(package, ()):
                found.append(f"{name} imports {target}: {package} must not know the library {other}")
            elif package == other == "dreamfields_core" and room and other_room and room != other_room:
                for unknown in {room, other_room} - LEVEL.keys():
                    found.append(f"{name} imports {target}: the room {unknown} stands on no floor; give it one in {Path(__file__).name}")
                if LEVEL.get(room, -1) >= LEVEL.get(other_room, len(FLOORS)):
                    found.append(f"{name} imports {target}: {other_room} is not on a floor below {room}")
    try:
        graphlib.TopologicalSorter({name: targets & modules.keys() for name, targets in arrows.items()}).prepare()
    except graphlib.CycleError as error:
        found.append("a circle: " + " -> ".join(reversed(error.args[1])))
    return found


def test_arrows_run_one_way() -> None:
    assert faults(read(REPO, PACKAGES)) == []


def test_every_room_of_the_core_stands_on_a_floor() -> None:
    rooms = {name.split(".")[1] for name in read(REPO, ["dreamfields_core"]) if "." in name}
    assert rooms <= LEVEL.keys()


@pytest.mark.parametrize(
    ("modules", "complaint"),
    [
        ({"tasks.mesh": "import flows.dream", "flows.dream": ""}, "tasks must not know flows"),
        ({"storage.digests": "def f():\n    from dreamfields_core import types"}, "storage must not know dreamfields_core"),
        ({"dreamfields_core.fields.grid": "import zarr.storage"}, "must not know the library zarr"),
        ({"dreamfields_core.scene.rays": "from dreamfields_core.rendering import images"}, "rendering is not on a floor below scene"),
        ({"dreamfields_core.scene.rays": "from ..fields.grid import Grid"}, "fields is not on a floor below scene"),
        ({"dreamfields_core.attic.box": "import dreamfields_core.types"}, "the room attic stands on no floor"),
        ({"tasks": "", "tasks.a": "from . import b", "tasks.b": "from tasks.a import x"}, "a circle"),
    ],
)
def test_a_planted_fault_is_found(modules: Modules, complaint: str) -> None:
    assert any(complaint in fault for fault in faults(modules)), faults(modules)


def test_arrows_downstairs_are_fine() -> None:
    modules = {
        "flows.dream": "import prefect\nfrom tasks import mesh",
        "tasks": "",
        "tasks.mesh": "from dreamfields_core.meshing import clean\nfrom storage import digests",
        "storage": "",
        "storage.digests": "import zarr",
        "dreamfields_core.meshing": "",
        "dreamfields_core.meshing.clean": "from dreamfields_core.judging.images import psnr\nfrom .errors import MeshError",
        "dreamfields_core.meshing.errors": "from dreamfields_core.types import Mesh",
        "dreamfields_core.types": "import jax",
    }
    assert faults(modules) == []

"""What can be asked of a mesh, and that nothing can be asked in vain."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dreamfields_core.config import ConfigError, MeshConfig, override
from dreamfields_core.meshing.errors import BadResolution
from dreamfields_core.meshing.lattice import Lattice
from dreamfields_core.presets import PRESETS, preset

TASK = Path(__file__).resolve().parents[2] / "tasks" / "mesh.py"


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("mesh.details=[20000]", "expected details that fall"),
        ("mesh.details=[5000,5000]", "expected details that fall"),
        ("mesh.details=[3]", "greater than or equal to 4"),
        ("mesh.texture=128", "greater than or equal to 256"),
        ("mesh.texture=8192", "less than or equal to 4096"),
        ("mesh.error=0", "greater than 0"),
        ("mesh.smooth=-1", "greater than or equal to 0"),
        ("mesh.color_samples=0", "greater than or equal to 1"),
        ("mesh.resolution=129", "take 192"),
        ("mesh.resolution=255", "take 256"),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(setting: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told) as caught:
        override(preset("draft"), (setting,))
    assert "mesh" in str(caught.value) and "\n" not in str(caught.value)


def test_a_resolution_is_refused_before_the_dream_exactly_where_no_lattice_can_have_it() -> None:
    def fits(make: Callable[[int], object], resolution: int, refusal: type[Exception]) -> bool:
        try:
            make(resolution)
        except refusal:
            return False
        return True

    for resolution in range(16, 1025):
        asked = fits(lambda cells: MeshConfig(resolution=cells), resolution, ValueError)
        assert asked == fits(lambda cells: Lattice((0.0, 0.0, 0.0), 1.0, cells), resolution, BadResolution), resolution
    assert MeshConfig(resolution=150).resolution == 150


def test_a_normal_map_wants_a_texture() -> None:
    with pytest.raises(ConfigError, match=r"set mesh\.texture=1024"):
        override(preset("draft"), ("mesh.texture=null", "mesh.normal_map=true"))


def test_levels_of_detail_fall_from_the_budget() -> None:
    config = override(preset("draft"), ("mesh.faces=20000", "mesh.details=[5000,1000]"))
    assert config.mesh.details == (5000, 1000)


def test_every_preset_gives_a_textured_mesh() -> None:
    assert {PRESETS[name].mesh.texture for name in PRESETS} == {1024}


@pytest.mark.parametrize("name", MeshConfig.model_fields)
def test_every_setting_is_read_by_the_step(name: str) -> None:
    assert f"wanted.{name}" in TASK.read_text(encoding="utf-8")

"""`dreamfields mesh`: other settings of the mesh for a dream that is there, which is not dreamed again."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from dreamfields_core.meshing import from_glb, provenance_of
from flows import asset_commands
from flows.exports import FORMATS
from flows.order import OrderError
from flows.remesh import find, remesh
from storage.artifacts import put_artifact
from storage.errors import BadAddress
from storage.store import open_store
from tests.flows.conftest import CAPTION, Dreams
from tests.flows.records import keep_dream
from tests.tasks.processes import Process


@pytest.fixture
def folder(again: Dreams) -> Path:
    """The finished dream's own folder, of a store that is a copy."""
    path = next(path for path in again.out.iterdir() if path.name.startswith("a-red-mushroom-"))
    said = json.loads((path / "result.json").read_text())
    (path / "result.json").write_text(json.dumps({**said, "store": str(again.out / "store")}))
    return path


def test_the_formats_are_those_of_the_core() -> None:
    from dreamfields_core.meshing import FORMATS as WRITERS

    assert set(FORMATS) == set(WRITERS)


@pytest.mark.slow
def test_a_dream_is_meshed_again_from_its_folder(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = Process(
        "flows.cli", "mesh", str(folder), "--faces", "200", "--texture", "256", "--format", "glb", "--format", "usdz", "--out", str(out)
    )
    assert process.end() == 0, process.text()
    assert {path.name for path in out.iterdir()} == {"mesh.glb", "mesh.usdz"}
    mesh = (out / "mesh.glb").read_bytes()
    texture = from_glb(mesh).texture
    assert len(from_glb(mesh).faces) <= 200 and texture is not None and texture.color.shape == (256, 256, 3)
    assert provenance_of(mesh)["caption"] == CAPTION and "Apache-2.0" in provenance_of(mesh)["licence"]


@pytest.mark.slow
def test_the_same_settings_are_answered_by_the_dream_s_own_record(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*arguments: object) -> None:
        raise AssertionError("meshed again")

    monkeypatch.setattr("tasks.mesh.mesh", never)
    remesh(str(folder), formats=["glb"], settings=[], out=tmp_path / "out")
    assert (tmp_path / "out" / "mesh.glb").read_bytes() == (folder / "mesh.glb").read_bytes()


@pytest.mark.slow
def test_the_folder_s_own_field_takes_the_place_of_a_lost_store(folder: Path) -> None:
    before = find(str(folder))
    shutil.rmtree(folder.parent / "store")
    lost = find(str(folder))
    assert lost == before or (lost.field, lost.guide) == (before.field, before.guide)
    assert lost.store.head(lost.field.key) == lost.field.size


def test_a_dream_is_named_by_its_caption_or_key_in_the_store(tmp_path: Path) -> None:
    store = open_store(tmp_path / "store")
    field = {"field.safetensors": b"field"}
    mug, *mushrooms = (keep_dream(store, caption, seed=seed, files=field) for caption, seed in (("a mug", 0), (CAPTION, 0), (CAPTION, 1)))
    assert find("A Mug", store.url).field == mug.output("field.safetensors")
    assert find(mushrooms[1].key[:10], store.url).config.seed == 1
    with pytest.raises(OrderError, match=f"{mushrooms[0].key[:12]} .seed 0."):
        find(CAPTION, store.url)
    for unknown in ("a red rug", "abcdef123456", str(tmp_path), ""):
        with pytest.raises(OrderError, match="a dream's folder, or a record's key or a caption"):
            find(unknown, store.url)


def test_a_named_store_takes_the_place_of_the_folder_s_own(tmp_path: Path) -> None:
    own, other = open_store(tmp_path / "own"), open_store(tmp_path / "other")
    ref, folder = put_artifact(own, "field.safetensors", b"field", "application/octet-stream"), tmp_path / "dream"
    folder.mkdir()
    (folder / ref.name).write_bytes(b"field")
    said = {"caption": CAPTION, "config": {"seed": 3}, "artifacts": [ref.to_json()], "encoders": {"guidance": {"digest": "a" * 64}}}
    (folder / "result.json").write_text(json.dumps({**said, "store": own.url}))
    assert find(str(folder)).store.url == own.url and other.head(ref.key) is None
    named = find(str(folder), other.url)
    assert named.store.url == other.url and other.head(ref.key) == len(b"field") and named.config.seed == 3
    with pytest.raises(BadAddress, match="s3://bucket/prefix"):
        asset_commands.mesh(str(folder), store="ftp://somewhere")


def test_what_would_change_the_field_is_refused(tmp_path: Path) -> None:
    store = open_store(tmp_path / "store")
    keep_dream(store, "a mug", files={"field.safetensors": b"field"})
    with pytest.raises(OrderError, match=r"settings of the mesh .*, got optim.steps=3"):
        remesh("a mug", store=store.url, formats=["glb"], settings=["optim.steps=3"])
    with pytest.raises(OrderError, match="a format among"):
        remesh("a mug", store=store.url, formats=["fbx"], settings=[])
    (tmp_path / "dream").mkdir()
    (tmp_path / "dream" / "result.json").write_text("{}")
    with pytest.raises(OrderError, match=r"the result.json of a dream"):
        find(str(tmp_path / "dream"), store.url)

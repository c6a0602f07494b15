"""Content-addressed files and their references."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from storage.artifacts import ArtifactRef, export, get_artifact, is_intact, is_present, put_artifact
from storage.contract import Store
from storage.errors import BadReference, DamagedArtifact, MissingArtifact

DATA = bytes(range(256)) * 8
HEX = "ab" * 32


def test_put_get(store: Store) -> None:
    ref = put_artifact(store, "mesh", DATA, "model/gltf-binary")
    assert get_artifact(store, ref) == DATA
    assert ref.key == f"blobs/sha256/{ref.sha256[:2]}/{ref.sha256}"
    assert store.list() == [ref.key]
    assert is_present(store, ref) and is_intact(store, ref)
    assert put_artifact(store, "same bytes", DATA, "x/y").key == ref.key


def test_a_reference_travels_as_json() -> None:
    ref = ArtifactRef("mesh", "model/gltf-binary", f"cas:sha256/{HEX}", HEX, 3)
    assert ArtifactRef.from_json(json.loads(json.dumps(ref.to_json()))) == ref
    assert sorted(ref.to_json()) == ["media_type", "name", "sha256", "size", "uri"]


@pytest.mark.parametrize(
    "change",
    [
        {"uri": f"cas:sha256/{'cd' * 32}"},
        {"sha256": "../../etc"},
        {"size": -1},
        {"size": "3"},
        {"size": True},
        {"name": None},
        {"extra": 1},
    ],
)
def test_bad_references_are_refused(change: dict[str, object]) -> None:
    good = {"name": "mesh", "media_type": "x/y", "uri": f"cas:sha256/{HEX}", "sha256": HEX, "size": 3}
    with pytest.raises(BadReference, match="Expected"):
        ArtifactRef.from_json({**good, **change})
    with pytest.raises(BadReference):
        ArtifactRef.from_json("mesh")


def test_a_deleted_artifact(store: Store) -> None:
    ref = put_artifact(store, "mesh", DATA, "x/y")
    store.delete(ref.key)
    assert not is_present(store, ref) and not is_intact(store, ref)
    with pytest.raises(MissingArtifact, match="run the step again"):
        get_artifact(store, ref)


@pytest.mark.parametrize("position", [0, 1000, -1])
def test_a_flipped_byte_is_noticed_and_mended(store: Store, flip: Callable[..., None], position: int) -> None:
    ref = put_artifact(store, "mesh", DATA, "x/y")
    flip(store, ref.key, position)
    assert is_present(store, ref) and not is_intact(store, ref)
    with pytest.raises(DamagedArtifact, match="run the step again"):
        get_artifact(store, ref)
    assert put_artifact(store, "mesh", DATA, "x/y") == ref
    assert get_artifact(store, ref) == DATA


def test_a_truncated_artifact(store: Store) -> None:
    ref = put_artifact(store, "mesh", DATA, "x/y")
    store.put(ref.key, DATA[:-1])
    assert not is_present(store, ref)
    with pytest.raises(DamagedArtifact):
        get_artifact(store, ref)


def test_the_empty_artifact(store: Store) -> None:
    ref = put_artifact(store, "nothing", b"", "text/plain")
    assert get_artifact(store, ref) == b"" and is_intact(store, ref)


def test_export_writes_only_what_changed(store: Store, tmp_path: Path) -> None:
    ref, path = put_artifact(store, "mesh", DATA, "x/y"), tmp_path / "out/mesh.glb"
    assert export(store, ref, path)
    assert not export(store, ref, path)
    path.write_bytes(DATA[:-1] + b"?")
    assert export(store, ref, path)
    assert path.read_bytes() == DATA
    store.put(ref.key, b"damaged")
    with pytest.raises(DamagedArtifact):
        export(store, ref, tmp_path / "other.glb")
    assert [p.name for p in tmp_path.iterdir() if p.name != "store"] == ["out"]

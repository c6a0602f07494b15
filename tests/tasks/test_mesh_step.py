"""The mesh step on fields that give no mesh, on disks without room, and on one that does: the dream itself is never touched."""

from __future__ import annotations

import errno
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.dreaming.state import state_to_arrays
from dreamfields_core.fields import build_field
from dreamfields_core.meshing import FieldEmpty, FieldFull, FieldNotFinite, MeshError, from_glb, report, weld
from dreamfields_core.rendering.occupancy import unknown_occupancy
from storage import local
from storage.artifacts import ArtifactRef, get_artifact, put_artifact
from storage.contract import Store
from storage.errors import StorageFull
from storage.steps import find_record
from storage.store import open_store
from tasks.finished_field import pack_field
from tasks.step import Done, Place, key_of, perform
from tasks.steps import MESH
from tests.tasks.tiny import tiny

LEVEL = "mesh.level=5"


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store")


def dreamt(store: Store, *, spoiled: bool = False) -> ArtifactRef:
    """The ball that every hybrid field starts from, as if it had been dreamed."""
    config = tiny()
    params = build_field(config.field, bound=config.scene.bound).init(jax.random.key(0))
    if spoiled:
        params = jax.tree.map(lambda leaf: jnp.full_like(leaf, jnp.nan), params)
    state = {"params": params, "origin": jnp.zeros(3), "occupancy": unknown_occupancy(config.render.skip.resolution)}
    return put_artifact(store, "field.safetensors", pack_field(state_to_arrays(state), config), "application/x-safetensors")  # type: ignore[arg-type]


def meshed(store: Store, field: ArtifactRef, *settings: str) -> Done:
    return perform(MESH, Place(store), tiny(*settings), inputs(field))


def inputs(field: ArtifactRef) -> dict[str, str | int | ArtifactRef]:
    return {"field": field, "caption": "a ball", "guide": "0" * 64}


def test_a_textured_mesh_and_a_lighter_one_with_their_fidelity(store: Store) -> None:
    made = meshed(store, dreamt(store), LEVEL, "mesh.details=[200]").record
    assert {"mesh.glb", "mesh_lod1.glb"} <= {ref.name for ref in made.outputs}
    for name, most in (("mesh.glb", 800), ("mesh_lod1.glb", 200)):
        mesh = from_glb(get_artifact(store, made.output(name)))
        assert mesh.texture is not None and mesh.texture.color.shape == (256, 256, 3) and mesh.normals is not None
        assert report(weld(mesh)).watertight and len(mesh.faces) <= most
    assert made.values["mesh"]["crossing"] == 0 and made.values["mesh"]["winding"] and len(made.values["details"]) == 1
    assert set(made.values["fidelity"]) == {"silhouette", "silhouettes", "image", "depth"}


@pytest.mark.parametrize(
    ("settings", "spoiled", "error", "way_out"),
    [
        (("mesh.level=1e6",), False, FieldEmpty, "lower the level"),
        (("mesh.level=1e-12",), False, FieldFull, "raise the level"),
        ((LEVEL,), True, FieldNotFinite, "earlier checkpoint"),
    ],
)
def test_a_field_without_a_surface_costs_one_sentence_and_nothing_else(
    store: Store, settings: tuple[str, ...], spoiled: bool, error: type[MeshError], way_out: str
) -> None:
    field = dreamt(store, spoiled=spoiled)
    before = get_artifact(store, field)
    with pytest.raises(error, match=way_out) as caught:
        meshed(store, field, *settings)
    assert "\n" not in str(caught.value) and get_artifact(store, field) == before
    assert find_record(store, "mesh", key_of(MESH, tiny(*settings), inputs(field))) is None


def test_a_full_disk_costs_one_sentence_and_the_next_try_succeeds(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    field = dreamt(store)
    before, write = get_artifact(store, field), local.write_synced

    def full(path: Path, data: bytes) -> None:
        if data[:4] == b"glTF":
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, data)

    with monkeypatch.context() as patched:
        patched.setattr(local, "write_synced", full)
        with pytest.raises(StorageFull, match="free some space") as caught:
            meshed(store, field, LEVEL)
    assert "\n" not in str(caught.value) and get_artifact(store, field) == before
    assert not meshed(store, field, LEVEL).cached
    assert np.isfinite(from_glb(get_artifact(store, meshed(store, field, LEVEL).output("mesh.glb"))).vertices).all()

"""Pulling: only what changed, verified, whole or not at all."""

from __future__ import annotations

import json
import shutil
import signal
import time
import urllib.request
from datetime import UTC, datetime
from pathlib import Path

import pytest

from flows.order import OrderError, sweep_key
from flows.pull import Only, Pulled, pull
from flows.pull_folder import MANIFEST
from flows.pull_object import ABOUT
from storage.contract import Entry, Store
from storage.digests import json_digest, sha256_file
from storage.errors import StoreNotWritable
from storage.steps import StepRecord, put_record
from storage.store import open_store
from tests.flows.records import glb, keep_dream
from tests.tasks.processes import Process


class Counting(Store):
    """A store that counts what is read."""

    def __init__(self, store: Store) -> None:
        self._store, self.url, self.read = store, store.url, list[str]()

    def get(self, key: str) -> bytes:
        self.read.append(key)
        return self._store.get(key)

    def put(self, key: str, data: bytes) -> None:
        raise AssertionError("a pull writes nothing to the store")

    create = put

    def delete(self, key: str) -> None:
        raise AssertionError("a pull deletes nothing from the store")

    def head(self, key: str) -> int | None:
        return self._store.head(key)

    def entries(self, prefix: str = "") -> list[Entry]:
        return self._store.entries(prefix)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store")


@pytest.fixture
def to(tmp_path: Path) -> Path:
    return tmp_path / "assets"


def objects(to: Path) -> dict[str, dict]:  # type: ignore[type-arg]
    return dict(json.loads((to / MANIFEST).read_text())["objects"])


def files(to: Path) -> dict[str, tuple[str, int]]:
    """Every visible file: its digest, and when it was written."""
    visible = [path for path in to.rglob("*") if path.is_file() and not any(part.startswith(".") for part in path.relative_to(to).parts)]
    return {path.relative_to(to).as_posix(): (sha256_file(path), path.stat().st_mtime_ns) for path in visible}


def counts(result: Pulled) -> tuple[int, ...]:
    return tuple(map(len, (result.added, result.changed, result.removed, result.same, result.refused)))


def assert_whole(to: Path) -> None:
    """Every object's folder is what its manifest says, and nothing is half there."""
    for name, about in objects(to).items():
        assert set(about["files"]) | {ABOUT} == {path.name for path in (to / name).iterdir()}
        assert all(sha256_file(to / name / file) == said["sha256"] for file, said in about["files"].items())
    assert not list(to.glob(".staging/*"))


def test_the_second_pull_of_500_objects_moves_no_bytes(to: Path) -> None:
    store = open_store("memory://")
    for seed in range(500):
        keep_dream(store, f"object number {seed % 50}", seed=seed)
    counting = Counting(store)
    first = pull(counting, to)
    assert counts(first) == (500, 0, 0, 0, 0) and first.moved > 0 and len(counting.read) == 1000
    before = files(to)
    counting.read.clear()
    second = pull(counting, to)
    assert counts(second) == (0, 0, 0, 500, 0) and second.moved == 0
    assert counting.read == [] and files(to) == before
    assert_whole(to)


@pytest.mark.parametrize("emptied", [False, True])
def test_a_store_without_dreams_is_refused_and_nothing_is_taken_for_removed(store: Store, to: Path, emptied: bool) -> None:
    if emptied:
        record = keep_dream(store)
        pull(store, to)
        store.delete(f"artifacts/dream/{record.key}.json")
    before = files(to)
    with pytest.raises(OrderError, match="check its address"):
        pull(store, to, prune=True)
    assert files(to) == before


def test_what_was_added_changed_and_removed_is_told(store: Store, to: Path) -> None:
    kept, changed, removed = (keep_dream(store, f"object {seed}", seed=seed) for seed in range(3))
    pull(store, to)
    keep_dream(store, "object 1", seed=1, mesh=b"another mesh")
    keep_dream(store, "object 3", seed=3)
    store.delete(f"artifacts/dream/{removed.key}.json")
    result = pull(store, to)
    assert [name.rpartition("-")[0] for name in (*result.added, *result.changed, *result.removed, *result.same)] == [
        "object-3",
        "object-1",
        "object-2",
        "object-0",
    ]
    assert result.removed[0] not in objects(to) and (to / result.removed[0]).is_dir()
    assert (to / result.changed[0] / "mesh.glb").read_bytes() == b"another mesh"
    assert kept.key != changed.key


def test_pruning_deletes_our_files_and_not_those_beside_them(store: Store, to: Path) -> None:
    alone, shared = (keep_dream(store, "an object", seed=seed) for seed in range(2))
    pull(store, to)
    names = {about["record"]: name for name, about in objects(to).items()}
    (to / names[shared.key] / "mesh.glb.meta").write_text("an engine's")
    keep_dream(store, "another")
    for record in (alone, shared):
        store.delete(f"artifacts/dream/{record.key}.json")
    assert len(pull(store, to, prune=True).removed) == 2
    assert not (to / names[alone.key]).exists()
    assert [path.name for path in (to / names[shared.key]).iterdir()] == ["mesh.glb.meta"]


def test_what_is_asked_for_again_is_stamped_anew_and_is_the_same(store: Store, to: Path) -> None:
    keep_dream(store)
    pull(store, to)
    before = files(to)
    keep_dream(store, created="2026-11-21T12:00:00+00:00")
    assert counts(pull(store, to)) == (0, 0, 0, 1, 0) and files(to) == before


def test_a_new_score_is_told_without_fetching_the_mesh(store: Store, to: Path) -> None:
    keep_dream(store, cosine=0.2)
    pull(store, to)
    keep_dream(store, cosine=0.4)
    result = pull(store, to)
    assert (len(result.changed), result.moved) == (1, 0)
    assert objects(to)[result.changed[0]]["scores"]["judge"]["cosine"] == 0.4
    assert_whole(to)


def test_a_tampered_artifact_is_refused_and_named_and_the_others_come(store: Store, to: Path) -> None:
    good, bad = keep_dream(store, "a good one"), keep_dream(store, "a bad one")
    ref = bad.output("mesh.glb")
    path = store.local_path(ref.key)
    assert path is not None
    path.write_bytes(b"X" + path.read_bytes()[1:])
    result = pull(store, to)
    (name,) = result.refused
    assert name.startswith("a-bad-one-") and "mesh.glb with digest" in result.refused[name]
    assert not (to / name).exists() and name not in objects(to)
    assert [about["record"] for about in objects(to).values()] == [good.key]


def test_a_tampered_artifact_leaves_the_older_good_one(store: Store, to: Path) -> None:
    keep_dream(store)
    (name,) = pull(store, to).added
    before = files(to)
    newer = keep_dream(store, mesh=b"a newer mesh")
    store.delete(newer.output("mesh.glb").key)
    assert list(pull(store, to).refused) == [name] and files(to) == before


def test_a_damaged_record_is_named(store: Store, to: Path) -> None:
    record = keep_dream(store)
    path = store.local_path(f"artifacts/dream/{record.key}.json")
    assert path is not None
    path.write_bytes(path.read_bytes().replace(b'"seed": 0', b'"seed": 1'))
    result = pull(store, to)
    assert list(result.refused) == [f"artifacts/dream/{record.key}.json"] and "checksum" in next(iter(result.refused.values()))


def test_a_record_that_cannot_be_read_is_not_taken_for_removed(store: Store, to: Path) -> None:
    record = keep_dream(store)
    (name,) = pull(store, to).added
    before = files(to)
    path = store.local_path(f"artifacts/dream/{record.key}.json")
    assert path is not None
    path.write_bytes(path.read_bytes().replace(b'"seed": 0', b'"seed": 1'))
    for prune in (False, True):
        result = pull(store, to, prune=prune)
        assert counts(result) == (0, 0, 0, 0, 1) and name in objects(to) and files(to) == before


def test_pruning_deletes_what_an_earlier_pull_let_stand(store: Store, to: Path, tmp_path: Path) -> None:
    kept, gone = (keep_dream(store, seed=seed) for seed in range(2))
    other = open_store(tmp_path / "other")
    there = keep_dream(other, "from there")
    pull(other, to)
    pull(store, to)
    name = next(name for name, about in objects(to).items() if about["record"] == gone.key)
    shutil.copytree(to / name, to / "a-copy")
    store.delete(f"artifacts/dream/{gone.key}.json")
    assert pull(store, to).removed == [name] and (to / name).is_dir()
    assert pull(store, to, prune=True).removed == [name] and not (to / name).exists()
    assert (to / "a-copy" / "mesh.glb").is_file(), "somebody's own"
    assert {about["record"] for about in objects(to).values()} == {kept.key, there.key}
    assert pull(store, to, prune=True).removed == []
    assert_whole(to)


def test_a_mesh_that_cannot_be_read_is_refused_and_the_others_come(store: Store, to: Path) -> None:
    good, bad = keep_dream(store, "a good one", mesh=glb()), keep_dream(store, "a bad one", mesh=b"no mesh")
    result = pull(store, to, formats=["stl"])
    (name,) = result.refused
    assert name.endswith(bad.key[:12]) and "a mesh to make stl of" in result.refused[name] and "\n" not in result.refused[name]
    assert [about["record"] for about in objects(to).values()] == [good.key]


def test_a_file_where_the_folder_should_be_is_one_sentence(store: Store, to: Path) -> None:
    keep_dream(store)
    to.write_text("a file")
    for folder in (to, to / "assets"):
        with pytest.raises(StoreNotWritable, match="choose a folder"):
            pull(store, folder)


@pytest.mark.parametrize("damage", ["flip", "delete", "about"])
def test_what_was_damaged_in_the_folder_is_brought_again(store: Store, to: Path, damage: str) -> None:
    keep_dream(store)
    (name,) = pull(store, to).added
    mesh = to / name / "mesh.glb"
    good = mesh.read_bytes()
    if damage == "delete":
        mesh.unlink()
    elif damage == "flip":
        mesh.write_bytes(b"x" * len(good))
    else:
        (to / name / ABOUT).write_text("{")
    assert pull(store, to).changed == [name] and mesh.read_bytes() == good
    assert_whole(to)


def test_filters(store: Store, to: Path) -> None:
    early = keep_dream(store, "A Red Mushroom", seed=1, cosine=0.1)
    late = keep_dream(store, "a red mug", seed=2, cosine=0.4, created="2026-11-21T08:00:00+00:00")
    members = [{"variant": "", "caption": "a red mug", "seed": 2, "key": late.key, "error": None}, {"key": None}]
    put_record(store, StepRecord(step="sweep", version=1, key=sweep_key("mugs"), values={"name": "mugs", "entries": members}))

    def found(**only: object) -> set[str]:
        target = to / json_digest(str(only))[:8]
        pull(store, target, only=Only(**only))  # type: ignore[arg-type]
        return {about["record"] for about in objects(target).values()}

    both = {early.key, late.key}
    assert found() == found(caption="red m") == found(min_score=0.1) == both
    assert found(caption="mushroom") == found(seed=1) == {early.key}
    assert found(min_score=0.2) == found(since=datetime(2026, 11, 21, tzinfo=UTC)) == found(sweep="mugs") == {late.key}
    assert found(caption="mushroom", seed=2) == set()
    with pytest.raises(OrderError, match='got "rugs"'):
        found(sweep="rugs")


def test_a_moment_without_a_zone_is_utc(store: Store, to: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep_dream(store, created="2026-11-21T08:00:00+00:00")
    monkeypatch.setenv("TZ", "America/New_York")
    time.tzset()
    try:
        assert len(pull(store, to, only=Only(since=datetime(2026, 11, 21, 7))).added) == 1
        assert counts(pull(store, to, only=Only(since=datetime(2026, 11, 21, 9)))) == (0, 0, 0, 0, 0)
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_narrower_pull_leaves_what_a_wider_one_brought(store: Store, to: Path) -> None:
    for seed in range(3):
        keep_dream(store, seed=seed)
    pull(store, to)
    before = files(to)
    assert counts(pull(store, to, only=Only(seed=1))) == (0, 0, 0, 1, 0) and files(to) == before


def test_formats_and_further_files(store: Store, to: Path) -> None:
    more = {"turntable.mp4": b"film", "mesh_lod1.glb": glb(), "field.safetensors": b"field", "../../escaped.txt": b"!"}
    keep_dream(store, mesh=glb(), files=more)
    (name,) = pull(store, to).added
    assert {path.name for path in (to / name).iterdir()} == {"mesh.glb", "mesh_lod1.glb", ABOUT}
    pull(store, to, formats=["usdz", "obj"], also=["turntable.mp4"])
    made = {f"{mesh}{end}" for mesh in ("mesh", "mesh_lod1") for end in (".usdz", ".obj", ".mtl", ".png", "_normal.png", ".json")}
    assert made | {"turntable.mp4"} == set(objects(to)[name]["files"])
    assert b"mtllib mesh_lod1.mtl" in (to / name / "mesh_lod1.obj").read_bytes()
    assert pull(store, to, formats=["obj", "usdz"], also=["turntable.mp4"]).moved == 0
    assert pull(store, to / "other", also=["../../escaped.txt"]).refused
    with pytest.raises(OrderError, match="a format among glb, obj, ply, stl, usdz"):
        pull(store, to, formats=["fbx"])


@pytest.mark.slow
def test_a_killed_pull_leaves_no_half_file_and_the_next_one_goes_on(store: Store, to: Path) -> None:
    for seed in range(150):
        keep_dream(store, seed=seed, mesh=bytes([seed]) * 20_000)
    process = Process("flows.cli", "pull", "--store", store.url, "--to", str(to))
    deadline = time.monotonic() + 120
    while not list(to.glob("a-red-mushroom-*")) and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.05)
    process.process.send_signal(signal.SIGKILL)
    process.process.wait()
    there = [path for path in to.iterdir() if not path.name.startswith(".") and path.is_dir()]
    assert len(there) > 0
    for folder in there:
        about = json.loads((folder / ABOUT).read_text())
        assert {name: sha256_file(folder / name) for name in about["files"]} == {n: f["sha256"] for n, f in about["files"].items()}
    counting = Counting(store)
    pull(counting, to)
    fetched = [key for key in counting.read if key.startswith("blobs/")]
    assert len(objects(to)) == 150 and len(fetched) <= 150 - len(there)
    assert_whole(to)


def test_a_full_disk_is_an_error_and_leaves_what_was_there(store: Store, to: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from storage import local
    from storage.errors import StorageFull

    keep_dream(store)
    pull(store, to)
    before = files(to)
    keep_dream(store, mesh=b"m" * 1000)

    def full(path: Path, data: bytes) -> None:
        import errno

        if len(data) == 1000:
            raise OSError(errno.ENOSPC, "No space left on device")
        original(path, data)

    original = local.write_synced
    monkeypatch.setattr(local, "write_synced", full)
    with pytest.raises(StorageFull, match="the disk is full"):
        pull(store, to)
    assert files(to) == before and not list(to.glob(".staging/*"))


@pytest.mark.slow
def test_an_object_store_gives_the_same(store: Store, to: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    address = "http://{}:{}".format(*server.get_host_and_port())
    for name, value in {"ENDPOINT_URL": address, "REGION": "us-east-1", "ACCESS_KEY_ID": "test", "SECRET_ACCESS_KEY": "test"}.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    urllib.request.urlopen(urllib.request.Request(f"{address}/pulled", method="PUT")).close()
    remote = open_store("s3://pulled/dreams")
    for seed in range(10):
        keep_dream(remote, seed=seed)
        keep_dream(store, seed=seed)
    assert counts(pull("s3://pulled/dreams", to)) == (10, 0, 0, 0, 0)
    counting = Counting(remote)
    assert counts(pull(counting, to)) == (0, 0, 0, 10, 0) and counting.read == []
    pull(store, to / "local")
    strip = {name: {**about, "store": ""} for name, about in objects(to).items()}
    assert strip == {name: {**about, "store": ""} for name, about in objects(to / "local").items()}
    server.stop()


def test_a_folder_may_collect_from_several_stores(store: Store, to: Path, tmp_path: Path) -> None:
    keep_dream(store, "from here")
    other = open_store(tmp_path / "other")
    keep_dream(other, "from there")
    pull(store, to)
    (there,) = pull(other, to).added
    assert {about["caption"] for about in objects(to).values()} == {"from here", "from there"}
    keep_dream(other, "from there too")
    store_keys = other.list("artifacts/dream")
    other.delete(next(key for key in store_keys if objects(to)[there]["record"] in key))
    result = pull(other, to)
    assert (result.removed, len(result.added)) == ([there], 1)
    assert {about["caption"] for about in objects(to).values()} == {"from here", "from there too"}


@pytest.mark.slow
def test_the_flow_is_the_same_pull(store: Store, to: Path) -> None:
    from prefect.testing.utilities import prefect_test_harness

    from flows.pull_flow import PullIncomplete, pull_assets

    good, bad = keep_dream(store, "a good one"), keep_dream(store, "a bad one", seed=1)
    store.delete(bad.output("mesh.glb").key)
    with prefect_test_harness(server_startup_timeout=120):
        result = pull_assets(store.url, str(to), seed=0)
        with pytest.raises(PullIncomplete, match="every object to be whole, but 1 are not: a-bad-one-"):
            pull_assets(store.url, str(to))
    assert [about["record"] for about in objects(to).values()] == [good.key]
    assert result["added"] == list(objects(to)) and result["refused"] == {} and json.dumps(result)

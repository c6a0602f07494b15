"""What every store promises."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from storage.contract import Store
from storage.errors import AlreadyExists, BadAddress, BadKey, MissingObject, StorageError, StoreNotWritable, StoreUnreachable
from storage.store import open_store


def test_put_get_replace_delete(store: Store) -> None:
    store.put("a/b.json", b"one")
    assert (store.get("a/b.json"), store.head("a/b.json")) == (b"one", 3)
    store.put("a/b.json", b"three")
    assert (store.get("a/b.json"), store.head("a/b.json")) == (b"three", 5)
    store.delete("a/b.json")
    assert store.head("a/b.json") is None
    store.delete("a/b.json")
    with pytest.raises(MissingObject, match="found none"):
        store.get("a/b.json")


def test_a_folder_is_no_object(store: Store) -> None:
    store.put("a/b/c", b"x")
    assert store.head("a/b") is None
    with pytest.raises(MissingObject):
        store.get("a/b")


def test_create_only(store: Store) -> None:
    store.create("claims/1", b"mine")
    store.create("claims/1", b"mine")  # a retried request meets itself
    with pytest.raises(AlreadyExists, match="other bytes"):
        store.create("claims/1", b"yours")
    assert store.get("claims/1") == b"mine"


def test_of_many_creators_one_wins(store: Store) -> None:
    def attempt(number: int) -> bool:
        try:
            store.create("claims/1", f"writer {number}".encode())
        except AlreadyExists:
            return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(attempt, range(8))) == 1


def test_a_prefix_is_a_folder(store: Store) -> None:
    for key in ("runs/ab/1", "runs/a/2", "runs/a/1", "runs/a/deep/3", "other"):
        store.put(key, key.encode())
    assert store.list("runs/a") == ["runs/a/1", "runs/a/2", "runs/a/deep/3"]
    assert store.list("nowhere") == []
    assert len(store.list()) == 5
    assert [(entry.key, entry.size) for entry in store.entries("runs/ab")] == [("runs/ab/1", 9)]
    assert store.entries("other") == []


def test_entries_know_their_age(store: Store) -> None:
    import time

    store.put("a/now", b"")
    assert abs(store.entries("a")[0].modified - time.time()) < 60


@pytest.mark.parametrize("key", ["", "/a", "a/", "a//b", "../a", "a/../b", ".hidden", "a b", "a\\b", "a\0", "ä", "a" * 300])
def test_unclean_keys_are_refused(store: Store, key: str) -> None:
    for use in (
        store.get,
        store.head,
        store.delete,
        store.locate,
        store.local_path,
        lambda k: store.put(k, b""),
        lambda k: store.create(k, b""),
    ):
        with pytest.raises(BadKey, match="Expected a key"):
            use(key)  # type: ignore[operator]


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=2000), key=st.from_regex(r"[a-z0-9_=+@-]{1,8}(/[A-Za-z0-9][A-Za-z0-9_=+@.-]{0,8}){1,3}", fullmatch=True))
def test_any_bytes_under_any_clean_key(store: Store, key: str, data: bytes) -> None:
    store.put(f"deep/{key}/end", data)
    assert store.get(f"deep/{key}/end") == data
    assert f"deep/{key}/end" in store.list("deep")


def test_writable_leaves_nothing(store: Store) -> None:
    store.check_writable()
    assert store.list() == []


def test_addresses(tmp_path: Path, s3: str) -> None:
    assert open_store(tmp_path / "a").local_path("b/c") == tmp_path / "a/b/c"
    assert open_store(f"file://{tmp_path}/a%20b").local_path("c") == tmp_path / "a b/c"
    assert open_store("memory://").local_path("c") is None
    assert open_store(f"{s3}/x").locate("y") == f"{s3}/x/y"
    for address in ("", "gs://bucket", "http://host/x", "s3://", "s3:///prefix", "s3://bucket/a?b"):
        with pytest.raises(BadAddress, match="Expected"):
            open_store(address)


def test_reopening_finds_the_same(store: Store) -> None:
    if store.url != "memory://":
        store.put("a", b"kept")
        assert open_store(store.url).get("a") == b"kept"


def test_a_bucket_that_is_not_there(s3: str) -> None:
    with pytest.raises(StoreNotWritable, match="no such bucket"):
        open_store("s3://nobody-made-this/x").check_writable()


def test_a_server_that_does_not_answer(s3: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import storage.objects as objects

    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setattr(objects, "RETRIES", 0)
    with pytest.raises(StoreUnreachable, match="check AWS_ENDPOINT_URL"):
        open_store("s3://bucket/x").check_writable()


def test_every_error_is_a_storage_error() -> None:
    import storage.errors as errors

    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type)]
    assert all(issubclass(kind, StorageError) and kind.__doc__ for kind in kinds)

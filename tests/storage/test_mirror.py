"""Small objects with copies: read once, listed ever after."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from storage.contract import Store
from storage.mirror import mirrored


def test_every_object_is_read_once_until_it_changes(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, read = tmp_path / "copies", list[str]()
    original = store.get
    monkeypatch.setattr(store, "get", lambda key: (read.append(key), original(key))[1])
    for number in range(3):
        store.put(f"records/{number}.json", b"%d" % number)
    first = list(mirrored(store, "records", folder))
    assert first == [(f"records/{number}.json", b"%d" % number) for number in range(3)] and len(read) == 3
    assert list(mirrored(store, "records", folder)) == first and len(read) == 3
    store.put("records/1.json", b"another")
    store.delete("records/2.json")
    assert list(mirrored(store, "records", folder)) == [("records/0.json", b"0"), ("records/1.json", b"another")]
    assert read[3:] == ["records/1.json"]
    assert sorted(path.name for path in folder.iterdir()) == ["0.json", "1.json"]


def test_a_copy_of_another_time_is_not_believed(local: Store, tmp_path: Path) -> None:
    local.put("records/0.json", b"good")
    folder = tmp_path / "copies"
    list(mirrored(local, "records", folder))
    (folder / "0.json").write_bytes(b"evil")
    os.utime(folder / "0.json", (1, 1))
    assert list(mirrored(local, "records", folder)) == [("records/0.json", b"good")]


def test_nothing_is_there(store: Store, tmp_path: Path) -> None:
    assert list(mirrored(store, "nowhere", tmp_path / "copies")) == []

"""The cache that survives everything: a record counts only while all that it names is intact."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from storage.artifacts import put_artifact
from storage.contract import Store
from storage.errors import DamagedRecord, NotJson, StoreNotWritable
from storage.steps import StepRecord, find_record, put_record, record_key, step_lock
from storage.store import open_store

KEY = "12" * 32
Child = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def record(store: Store) -> StepRecord:
    """A kept record with two outputs."""
    outputs = tuple(put_artifact(store, name, name.encode() * 100, "x/y") for name in ("mesh", "texture"))
    config = {"mesh": {"faces": 5000}}
    return put_record(
        store, StepRecord("mesh", 2, KEY, config, {"field": "ab" * 32}, "abc123", 1.25, "", outputs, {"faces": [1, 2.5, None]})
    )


def test_a_record_comes_back(store: Store, record: StepRecord) -> None:
    assert find_record(store, "mesh", KEY) == record
    assert record.created.endswith("+00:00")
    assert record.output("texture").size == 700
    assert store.head(record_key("mesh", KEY))
    with pytest.raises(KeyError, match="use one of these"):
        record.output("film")


def test_no_record(store: Store) -> None:
    assert find_record(store, "mesh", KEY) is None


def test_a_deleted_output_is_a_miss(store: Store, record: StepRecord, caplog: pytest.LogCaptureFixture) -> None:
    store.delete(record.outputs[1].key)
    assert find_record(store, "mesh", KEY) is None
    assert find_record(store, "mesh", KEY, digests=False) is None
    assert "texture, made by mesh, is missing" in caplog.text and "done again" in caplog.text


def test_a_damaged_output_is_a_miss(store: Store, record: StepRecord, flip: Callable[..., None], caplog: pytest.LogCaptureFixture) -> None:
    flip(store, record.outputs[0].key, 50)
    assert find_record(store, "mesh", KEY, digests=False) == record
    assert find_record(store, "mesh", KEY) is None
    assert "mesh, made by mesh, is damaged" in caplog.text


@pytest.mark.parametrize("position", [0, 40, 200, -3])
def test_a_damaged_record_is_a_miss(
    store: Store, record: StepRecord, flip: Callable[..., None], caplog: pytest.LogCaptureFixture, position: int
) -> None:
    flip(store, record_key("mesh", KEY), position)
    assert find_record(store, "mesh", KEY) is None
    assert len(caplog.records) == 1
    put_record(store, record)
    assert find_record(store, "mesh", KEY) == record


def test_a_record_under_another_name_is_a_miss(store: Store, record: StepRecord) -> None:
    store.put(record_key("mesh", "34" * 32), store.get(record_key("mesh", KEY)))
    assert find_record(store, "mesh", "34" * 32) is None


def test_impossible_records() -> None:
    with pytest.raises(DamagedRecord, match="fields of a step record"):
        StepRecord.from_json({"step": "mesh"})
    with pytest.raises(NotJson):
        put_record(open_store("memory://"), StepRecord("mesh", 1, KEY, values={"loss": float("nan")}))


COMPUTE = """
import sys, time
from storage.steps import StepRecord, find_record, put_record, step_lock
from storage.store import open_store
store = open_store(sys.argv[1])
print("ready", flush=True)
with step_lock(store, "mesh", on_wait=lambda said: print(said, flush=True)):
    if find_record(store, "mesh", "k") is None:
        print("computing", flush=True)
        time.sleep(float(sys.argv[2]))
        put_record(store, StepRecord("mesh", 1, "k"))
print("done", flush=True)
"""


def test_two_processes_compute_once(local: Store, child: Child) -> None:
    said = [process.communicate()[0] for process in [child(COMPUTE, local.url, "0.6") for _ in range(3)]]
    assert sum("computing" in text for text in said) == 1
    assert all(text.endswith("done\n") for text in said)


def test_a_killed_holder_lets_go(local: Store, child: Child) -> None:
    holder = child(COMPUTE, local.url, "60")
    assert holder.stdout and [holder.stdout.readline() for _ in range(2)] == ["ready\n", "computing\n"]
    waited: list[str] = []
    got = threading.Event()

    def wait() -> None:
        with step_lock(local, "mesh", on_wait=waited.append):
            got.set()

    thread = threading.Thread(target=wait)
    thread.start()
    assert not got.wait(0.3)
    os.kill(holder.pid, signal.SIGKILL)
    assert got.wait(5)
    thread.join()
    assert waited == ["Another process is working on mesh: waiting for it to finish."]


def test_waiting_is_logged(local: Store, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    waiter = threading.Thread(target=lambda: step_lock(local, "mesh").__enter__())
    with step_lock(local, "mesh"), step_lock(local, "another"):
        waiter.start()
        time.sleep(0.2)
    waiter.join(5)
    assert caplog.text.count("waiting for it to finish") == 1


def test_errors_inside_the_lock_pass_through(local: Store) -> None:
    with pytest.raises(FileNotFoundError), step_lock(local, "mesh"):
        raise FileNotFoundError
    with step_lock(local, "mesh"):
        pass


def test_other_stores_have_no_lock() -> None:
    store = open_store("memory://")
    with step_lock(store, "mesh"), step_lock(store, "mesh"):
        pass


def test_a_lock_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreNotWritable, match="choose a folder"), step_lock(open_store(tmp_path / "file"), "mesh"):
        pass

"""Saving behind the loop's back: what was handed over is what is saved, and no error is lost."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from storage.checkpoints import CheckpointWriter, latest_checkpoint
from storage.contract import Store
from storage.errors import NotJson, StorageFull
from storage.saver import AsyncSaver


class Slow:
    """A store's put that waits for a signal, or fails."""

    def __init__(self, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
        self.go, self.real, self.error = threading.Event(), store.put, False
        monkeypatch.setattr(store, "put", self.put)

    def put(self, key: str, data: bytes) -> None:
        assert self.go.wait(10)
        if self.error:
            raise StorageFull("Expected room, but the disk is full: free some space.")
        self.real(key, data)


@pytest.fixture
def slow(local: Store, monkeypatch: pytest.MonkeyPatch) -> Slow:
    """The local store, made slow."""
    return Slow(local, monkeypatch)


def test_the_loop_goes_on_and_its_buffers_are_free(local: Store, slow: Slow) -> None:
    buffer, facts = np.ones(5, np.float32), {"list": [1]}
    with AsyncSaver(CheckpointWriter(local, "chair")) as saver:
        saver.save(1, {"a": buffer}, facts)
        buffer[:] = 7
        facts["list"].append(2)
        slow.go.set()
        manifest = saver.wait()
        assert manifest is not None and manifest.step == 1
        assert saver.wait() is None
    found = latest_checkpoint(local, "chair")
    assert found is not None and found.arrays["a"].tolist() == [1] * 5 and found.metadata == {"list": [1]}


def test_one_save_at_a_time(local: Store, slow: Slow) -> None:
    with AsyncSaver(CheckpointWriter(local, "chair")) as saver:
        saver.save(1, {"a": np.ones(1)})
        second = threading.Thread(target=lambda: saver.save(2, {"a": np.ones(1)}))
        second.start()
        second.join(0.2)
        assert second.is_alive()
        slow.go.set()
        second.join(5)
        assert not second.is_alive()
    found = latest_checkpoint(local, "chair")
    assert found is not None and found.step == 2


@pytest.mark.parametrize("call", ["save", "wait", "close"])
def test_an_error_is_raised_by_the_next_call(local: Store, slow: Slow, call: str) -> None:
    saver = AsyncSaver(CheckpointWriter(local, "chair"))
    slow.error = True
    slow.go.set()
    saver.save(1, {"a": np.ones(1)})
    with pytest.raises(StorageFull):
        {"save": lambda: saver.save(2, {}), "wait": saver.wait, "close": saver.close}[call]()
    slow.error = False
    if call != "close":
        saver.save(3, {"a": np.ones(1)})
        saver.close()
        found = latest_checkpoint(local, "chair")
        assert found is not None and found.step == 3


def test_the_error_under_way_matters_more(local: Store, slow: Slow, caplog: pytest.LogCaptureFixture) -> None:
    slow.error = True
    slow.go.set()
    with pytest.raises(KeyboardInterrupt), AsyncSaver(CheckpointWriter(local, "chair")) as saver:
        saver.save(1, {"a": np.ones(1)})
        raise KeyboardInterrupt
    assert "The last checkpoint was not saved" in caplog.text
    with pytest.raises(StorageFull), AsyncSaver(CheckpointWriter(local, "chair")) as saver:
        saver.save(1, {"a": np.ones(1)})


def test_jax_arrays_are_copied_to_the_host(local: Store) -> None:
    import jax.numpy as jnp

    with AsyncSaver(CheckpointWriter(local, "chair")) as saver:
        saver.save(1, {"a": jnp.arange(3, dtype=jnp.bfloat16), "b": jnp.float32(2)})
    found = latest_checkpoint(local, "chair")
    assert found is not None and found.arrays["a"].dtype == jnp.bfloat16 and found.arrays["b"].shape == ()


def test_bad_metadata_is_refused_at_once(local: Store) -> None:
    with AsyncSaver(CheckpointWriter(local, "chair")) as saver, pytest.raises(NotJson):
        saver.save(1, {}, {"loss": float("nan")})

"""Weights without pickle."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import ml_dtypes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

import storage.weights as weights
from storage.errors import MissingWeights, UnreadableWeights
from storage.weights import read_weights, shipped

ARRAYS: dict[str, np.ndarray] = {
    "b/kernel": np.arange(6, dtype=np.float32).reshape(2, 3),
    "a": np.array(3, np.int64),
    "half": np.ones((2, 0), np.float16),
}
DATA = save(ARRAYS, {"caption": "a red chair"})


def test_arrays_metadata_and_digest(tmp_path: Path) -> None:
    (tmp_path / "w.safetensors").write_bytes(DATA)
    for found in (read_weights(DATA), read_weights(tmp_path / "w.safetensors"), read_weights(str(tmp_path / "w.safetensors"))):
        assert list(found.arrays) == ["a", "b/kernel", "half"]
        assert all(np.array_equal(found.arrays[name], value) and found.arrays[name].dtype == value.dtype for name, value in ARRAYS.items())
        assert found.arrays["b/kernel"].flags.writeable
        assert found.metadata == {"caption": "a red chair"}
        assert found.sha256 == hashlib.sha256(DATA).hexdigest()


def test_bfloat16() -> None:
    value = np.array([1, -2.5, 3e38], ml_dtypes.bfloat16)
    header = json.dumps({"a": {"dtype": "BF16", "shape": [3], "data_offsets": [0, 6]}}).encode()
    data = len(header).to_bytes(8, "little") + header + value.tobytes()
    assert read_weights(data).arrays["a"].dtype == ml_dtypes.bfloat16
    assert read_weights(data).arrays["a"].tobytes() == value.tobytes()
    assert read_weights(data).metadata == {}


@pytest.mark.parametrize("length", [0, 4, 8, 50, len(DATA) - 1])
def test_a_truncated_file(tmp_path: Path, length: int) -> None:
    (tmp_path / "w.safetensors").write_bytes(DATA[:length])
    with pytest.raises(UnreadableWeights, match=r"Expected a complete safetensors file in .*w.safetensors.*fetch the file again"):
        read_weights(tmp_path / "w.safetensors")


@settings(max_examples=50)
@given(st.binary(max_size=300) | st.builds(lambda n, b: DATA[:n] + b + DATA[n + len(b) :], st.integers(0, 250), st.binary(max_size=3)))
def test_any_other_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        read_weights(data)
    except UnreadableWeights as problem:
        assert "Expected" in str(problem)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(MissingWeights, match="fetch them first"):
        read_weights(tmp_path / "none.safetensors")


def test_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "embedded").mkdir()
    (tmp_path / "embedded/judge.safetensors").write_bytes(DATA)
    monkeypatch.setattr(weights.resources, "files", lambda package: tmp_path)
    assert read_weights(shipped("judge")).metadata == {"caption": "a red chair"}
    for name in ("guide", "../embedded/judge", ""):
        with pytest.raises(MissingWeights, match="judge"):
            shipped(name)

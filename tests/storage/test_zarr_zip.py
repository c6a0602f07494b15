"""Arrays in a zip: every dtype and shape comes back, zarr itself reads it, and the same arrays give the same bytes."""

from __future__ import annotations

import zipfile
from pathlib import Path

import ml_dtypes
import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from storage.errors import BadLeaf, DamagedCheckpoint, NotJson
from storage.zarr_zip import pack, unpack

NATIVE = [np.dtype(name) for name in ["bool", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8", "c8", "c16", ">f4", ">i2"]]
EXTENDED = [np.dtype(t) for t in (ml_dtypes.bfloat16, ml_dtypes.float8_e4m3fn, ml_dtypes.float8_e5m2, ml_dtypes.int4)]
STATE: dict[str, np.ndarray] = {
    "params/layer_0/kernel": np.arange(12, dtype=np.float32).reshape(3, 4),
    "params/layer_0/bias": np.ones(4, ml_dtypes.bfloat16),
    "step": np.array(7),
    "empty": np.zeros((0, 3), np.float16),
}


@st.composite
def any_array(draw: st.DrawFn) -> np.ndarray:
    """Any dtype, 0 to 4 dimensions of 0 to 5, any order in memory."""
    dtype = draw(st.sampled_from(NATIVE + EXTENDED))
    shape = draw(hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5))
    if dtype in EXTENDED:
        value = draw(hnp.arrays(np.int8, shape, elements=st.integers(-7, 7))).astype(dtype)
    else:
        value = draw(hnp.arrays(dtype, shape))
    return value.T if draw(st.booleans()) else value


names = st.lists(
    st.text("abcé_0.' []<>", min_size=1, max_size=5).filter(lambda p: p.strip(".") and not p.startswith("__")), min_size=1, max_size=3
)


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal to the bit, NaN included."""
    little = np.asarray(a).dtype.newbyteorder("<")
    return b.dtype == little and b.shape == np.shape(a) and np.asarray(a).astype(little).tobytes() == b.tobytes()


@settings(max_examples=60)
@given(st.dictionaries(names.map(lambda parts: "x" * len(parts) + "/" + "/".join(parts)), any_array(), max_size=4))
def test_round_trip(arrays: dict[str, np.ndarray]) -> None:
    back, metadata = unpack(pack(arrays))
    assert sorted(back) == sorted(arrays) and metadata == {}
    assert all(same(value, back[name]) for name, value in arrays.items())
    assert all(value.flags.writeable for value in back.values())


@settings(max_examples=20)
@given(value=any_array())
def test_zarr_reads_what_we_wrote(tmp_path_factory: pytest.TempPathFactory, value: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("zip") / "a.zarr.zip"
    path.write_bytes(pack({"deep/er/leaf": value}, {"step": 3}))
    with zarr.storage.ZipStore(path, mode="r") as opened:
        group = zarr.open_group(opened, mode="r")
        assert dict(group.attrs) == {"metadata": {"step": 3}}
        leaf = group["deep/er/leaf"]
        assert isinstance(leaf, zarr.Array) and leaf.shape == value.shape
        if value.dtype in EXTENDED:
            assert leaf.attrs["logical_dtype"] == value.dtype.name
            assert np.asarray(leaf[...]).tobytes() == value.tobytes()
        else:
            assert same(value, np.asarray(leaf[...]))


def test_we_read_what_zarr_wrote(tmp_path: Path) -> None:
    with zarr.storage.ZipStore(tmp_path / "a.zip", mode="w") as opened:
        group = zarr.create_group(opened, attributes={"metadata": {"by": "zarr"}})
        group.create_array("a/b", data=STATE["params/layer_0/kernel"], chunks=(2, 2))
    arrays, metadata = unpack((tmp_path / "a.zip").read_bytes())
    assert metadata == {"by": "zarr"} and same(STATE["params/layer_0/kernel"], arrays["a/b"])


def test_same_arrays_same_bytes(tmp_path: Path) -> None:
    one = pack(STATE, {"b": 1, "a": 2})
    assert pack(dict(reversed(STATE.items())), {"a": 2, "b": 1}) == one
    (tmp_path / "a.zip").write_bytes(one)
    infos = zipfile.ZipFile(tmp_path / "a.zip").infolist()
    assert [info.filename for info in infos] == sorted(info.filename for info in infos)
    assert all(info.compress_type == zipfile.ZIP_STORED and info.date_time[0] == 1980 for info in infos)


@pytest.mark.parametrize("name", ["", "/a", "a/", "a//b", ".", "a/../b", "zarr.json", "__x", "a\\b", "a\n"])
def test_names_that_are_no_paths(name: str) -> None:
    with pytest.raises(BadLeaf, match="Expected a name"):
        pack({name: np.zeros(1)})


@pytest.mark.parametrize("value", [np.array("text"), np.array([None]), np.array(["2026-01-01"], "M8[D]"), np.zeros(1, [("a", "f4")])])
def test_dtypes_that_are_no_numbers(value: np.ndarray) -> None:
    with pytest.raises(BadLeaf, match="Expected numbers"):
        pack({"a": value})


def test_an_array_is_no_group() -> None:
    with pytest.raises(BadLeaf, match="got both"):
        pack({"a": np.zeros(1), "a/b": np.zeros(1)})
    with pytest.raises(BadLeaf, match="got both"):
        pack({"a/b/c": np.zeros(1), "a": np.zeros(1)})


def test_metadata_is_json() -> None:
    with pytest.raises(NotJson):
        pack({}, {"loss": float("nan")})
    assert unpack(pack({}, {"note": "ä", "list": [1, None]}))[1] == {"note": "ä", "list": [1, None]}


@pytest.mark.parametrize("data", [b"", b"PK", pack(STATE)[:-30], pack(STATE)[200:], b"\0" * 1000])
def test_what_is_no_zip(data: bytes) -> None:
    with pytest.raises(DamagedCheckpoint, match="use an older one"):
        unpack(data)

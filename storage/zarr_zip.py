"""A dict of arrays as one zip that is a zarr v3 group: `zarr.open_group(zarr.storage.ZipStore(path))` reads it.

Same arrays, same bytes: names are sorted, entries are stored (not deflated) and dated 1980. Each leaf is one chunk with
the codecs bytes, Zstd(1), Crc32c. The chunks are built directly, which costs a fifth of writing them through zarr;
reading goes through zarr itself. Zarr reads a missing chunk as zeros: only the digest of the whole file rules that out.

dtypes that zarr has no word for (bfloat16 and its kin) are stored as unsigned integers of the same width, with an
attribute `logical_dtype`.
"""

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import google_crc32c
import ml_dtypes
import numpy as np
from numcodecs.zstd import Zstd  # type: ignore[import-untyped]

from storage.digests import canonical_json
from storage.errors import BadLeaf, DamagedCheckpoint

LOGICAL = "logical_dtype"
METADATA = "metadata"
_DATE = (1980, 1, 1, 0, 0, 0)
_ZSTD = Zstd(level=1)
_ZARR_DTYPES = {"bool", "float16", "float32", "float64", "complex64", "complex128"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}


def pack(arrays: Mapping[str, Any], metadata: Mapping[str, Any] | None = None) -> bytes:
    """The zip's bytes. A name is a path, `params/layer_0/kernel`; metadata is JSON and becomes the group's attributes.

    Raises: BadLeaf, NotJson.
    """
    entries: dict[str, bytes] = {"zarr.json": _group({METADATA: dict(metadata or {})})}
    for name in sorted(arrays):
        for folder in _folders(name):
            entries.setdefault(f"{folder}/zarr.json", _group({}))
        if f"{name}/zarr.json" in entries or any(folder in arrays for folder in _folders(name)):
            raise BadLeaf(f"Expected {name!r} to be either an array or a group, got both: rename one of them.")
        entries.update(_leaf(name, np.asarray(arrays[name])))
    return _zip(entries)


def unpack(data: bytes) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays (writable, own memory) and metadata. Raises: DamagedCheckpoint."""
    import zarr  # half a second, paid by those who restore
    from zarr.core.buffer import default_buffer_prototype

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            as_buffer = default_buffer_prototype().buffer.from_bytes
            content = {name: as_buffer(archive.read(name)) for name in archive.namelist()}
        group = zarr.open_group(zarr.storage.MemoryStore(content), mode="r")
        leaves = [(name, node) for name, node in group.members(max_depth=None) if isinstance(node, zarr.Array)]
        return {name: _logical(node) for name, node in sorted(leaves)}, dict(group.attrs)[METADATA]  # type: ignore[return-value]
    except Exception as problem:  # a damaged zip can fail in any layer
        raise DamagedCheckpoint(
            f"Expected a zarr v3 zip, got {len(data)} bytes that do not decode ({problem}): use an older one."
        ) from problem


def _logical(node: Any) -> np.ndarray:
    """Read one leaf, with the dtype that it had."""
    value = np.array(node[...])
    name = node.attrs.get(LOGICAL)
    return value if name is None else value.view(np.dtype(getattr(ml_dtypes, str(name))))


def _leaf(name: str, value: np.ndarray) -> dict[str, bytes]:
    """The zip entries of one array: its zarr.json and its chunk."""
    stored, attributes = _storable(name, value)
    entries = {f"{name}/zarr.json": _array(stored, attributes)}
    if stored.size:  # an empty array has no chunk
        coordinates = "/".join(["c", *["0"] * stored.ndim])
        packed = _ZSTD.encode(stored.tobytes())
        entries[f"{name}/{coordinates}"] = packed + int(google_crc32c.value(packed)).to_bytes(4, "little")
    return entries


def _storable(name: str, value: np.ndarray) -> tuple[np.ndarray, dict[str, str]]:
    """`value` in a dtype that zarr knows, little-endian, and the attributes that undo it."""
    if value.dtype.name in _ZARR_DTYPES:
        return value.astype(value.dtype.newbyteorder("<"), order="C", copy=False), {}
    if getattr(ml_dtypes, value.dtype.name, None) is not None and value.dtype.itemsize in (1, 2):
        plain = np.array(value, order="C").view(f"<u{value.dtype.itemsize}")
        return plain, {LOGICAL: value.dtype.name}
    raise BadLeaf(f"Expected numbers or booleans in {name!r}, got dtype {value.dtype}: convert it to an array of numbers first.")


def _array(value: np.ndarray, attributes: dict[str, str]) -> bytes:
    """zarr.json of an array whose only chunk is all of it."""
    zero: Any = {"b": False, "c": [0.0, 0.0], "f": 0.0}.get(value.dtype.kind, 0)
    layout = {"name": "bytes", "configuration": {"endian": "little"}} if value.dtype.itemsize > 1 else {"name": "bytes"}
    zstd = {"name": "zstd", "configuration": {"level": 1, "checksum": False}}
    return canonical_json(
        {
            "zarr_format": 3,
            "node_type": "array",
            "shape": value.shape,
            "data_type": value.dtype.name,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [max(1, size) for size in value.shape]}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": zero,
            "codecs": [layout, zstd, {"name": "crc32c"}],
            "attributes": attributes,
            "storage_transformers": [],
        }
    )


def _group(attributes: dict[str, Any]) -> bytes:
    """zarr.json of a group."""
    return canonical_json({"zarr_format": 3, "node_type": "group", "attributes": attributes})


def _folders(name: str) -> list[str]:
    """The groups above a leaf, outermost first. Raises: BadLeaf for a name that is no path."""
    parts = name.split("/")
    if any(not p.strip(".") or p.startswith("__") or p == "zarr.json" or "\\" in p or not p.isprintable() for p in parts):
        raise BadLeaf(f"Expected a name such as 'params/layer_0/kernel', got {name!r}: use printable parts between single slashes.")
    return ["/".join(parts[:depth]) for depth in range(1, len(parts))]


def _zip(entries: dict[str, bytes]) -> bytes:
    """A stored zip whose bytes depend on the entries alone."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(entries):
            info = zipfile.ZipInfo(name, _DATE)
            info.create_system = 3  # Unix, wherever it is written
            info.external_attr = 0o644 << 16
            archive.writestr(info, entries[name])
    return buffer.getvalue()

"""Model weights in safetensors: plain arrays and a text header. No pickle is ever loaded."""

import json
import os
import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import ml_dtypes
import numpy as np
import safetensors

from storage.digests import sha256_bytes
from storage.errors import MissingWeights, UnreadableWeights

_DTYPES = {
    "BOOL": np.bool_, "U8": np.uint8, "I8": np.int8, "U16": np.uint16, "I16": np.int16, "U32": np.uint32, "I32": np.int32,
    "U64": np.uint64, "I64": np.int64, "F16": np.float16, "F32": np.float32, "F64": np.float64, "C64": np.complex64,
    "BF16": ml_dtypes.bfloat16, "F8_E4M3": ml_dtypes.float8_e4m3fn, "F8_E5M2": ml_dtypes.float8_e5m2,
}  # fmt: skip


@dataclass(frozen=True)
class Weights:
    """What a file held: arrays by name, the header's `__metadata__` (text to text), and the digest of the whole file."""

    arrays: dict[str, np.ndarray]
    metadata: dict[str, str]
    sha256: str


def read_weights(source: bytes | str | os.PathLike[str]) -> Weights:
    """Read a safetensors file, or its bytes. Raises: MissingWeights, UnreadableWeights."""
    data, where = (source, "the given bytes") if isinstance(source, bytes) else (_read(Path(source)), str(source))
    try:
        tensors = safetensors.deserialize(data)
    except safetensors.SafetensorError as problem:
        raise UnreadableWeights(
            f"Expected a complete safetensors file in {where}, got {len(data)} bytes that are none ({problem}): fetch the file again."
        ) from problem
    arrays = {name: _array(where, name, tensor) for name, tensor in tensors}
    return Weights(dict(sorted(arrays.items())), _metadata(data), sha256_bytes(data))


def shipped(name: str) -> Path:
    """The file of the weights that come with the package as storage/embedded/<name>.safetensors. Raises: MissingWeights."""
    folder = Path(str(resources.files("storage"))) / "embedded"
    path = folder / f"{name}.safetensors"
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", name) or not path.is_file():
        there = sorted(file.stem for file in folder.glob("*.safetensors"))
        raise MissingWeights(f"Expected shipped weights called {name!r}, but the package has {there or 'none'}: use one of these.")
    return path


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as problem:
        raise MissingWeights(f"Expected weights at {path}, got '{problem.strerror}': check the path, or fetch them first.") from problem


def _array(where: str, name: str, tensor: dict) -> np.ndarray:
    """One tensor as a writable array of its own."""
    dtype = _DTYPES.get(tensor["dtype"])
    if dtype is None:
        raise UnreadableWeights(
            f"Expected a dtype among {sorted(_DTYPES)}, got {tensor['dtype']} for {name!r} in {where}: convert the file."
        )
    return np.frombuffer(tensor["data"], np.dtype(dtype)).reshape(tensor["shape"])


def _metadata(data: bytes) -> dict[str, str]:
    """The header: 8 bytes of length, little-endian, then JSON, which deserialize has just found valid."""
    length = int.from_bytes(data[:8], "little")
    return dict(json.loads(data[8 : 8 + length]).get("__metadata__", {}))

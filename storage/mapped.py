"""Arrays of a weights file, read one at a time: safetensors mapped into memory, or npz without pickle.

A file is checked as a whole when it is opened, so that nothing is ever half-loaded.
"""

import json
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import safetensors

from storage.errors import MissingWeights, UnreadableWeights
from storage.weights import _DTYPES

PICKLED = (".bin", ".pt", ".pth", ".ckpt", ".pkl", ".pickle")
"""Endings of files that run code when they are loaded; they are never opened."""


class MappedArrays(Mapping[str, np.ndarray]):
    """Name -> array, read when asked for; `shapes` gives name -> shape without reading any."""

    def __init__(self, parts: list["SafetensorsFile | NpzFile"]) -> None:
        self._where = {name: part for part in parts for name in part.shapes}
        self.shapes = {name: shape for part in parts for name, shape in part.shapes.items()}

    def __getitem__(self, name: str) -> np.ndarray:
        return self._where[name].read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._where)

    def __len__(self) -> int:
        return len(self._where)


def map_arrays(paths: list[Path]) -> MappedArrays:
    """The arrays of one weights file, or of the several that it was cut into.

    Raises: MissingWeights, UnreadableWeights (truncated, pickled, another format, an unknown dtype).
    """
    return MappedArrays([_open(path) for path in paths])


@dataclass(frozen=True)
class SafetensorsFile:
    """One file: per array its dtype, shape and the offset of its first byte."""

    path: Path
    dtypes: dict[str, np.dtype]
    shapes: dict[str, tuple[int, ...]]
    offsets: dict[str, int]

    def read(self, name: str) -> np.ndarray:
        """One array, a view of the mapped file: copy it before the file may go."""
        return np.memmap(self.path, self.dtypes[name], "r", self.offsets[name], self.shapes[name] or (1,)).reshape(self.shapes[name])


@dataclass(frozen=True)
class NpzFile:
    """One zip of npy members; "params/" in front of all names, as some writers put it, is dropped."""

    path: Path
    shapes: dict[str, tuple[int, ...]]
    members: dict[str, str]

    def read(self, name: str) -> np.ndarray:
        """One array. Raises: UnreadableWeights where the zip's own checksum finds it damaged."""
        try:
            with zipfile.ZipFile(self.path) as archive, archive.open(self.members[name]) as member:
                return np.lib.format.read_array(member, allow_pickle=False)
        except (OSError, ValueError, zipfile.BadZipFile) as problem:
            raise UnreadableWeights(f"Expected {name!r} in {self.path}, got a damaged one ({problem}): fetch the file again.") from problem


def _open(path: Path) -> SafetensorsFile | NpzFile:
    if path.suffix in PICKLED:
        raise UnreadableWeights(
            f"Expected safetensors or npz, got {path.name}, a pickle, which runs code when it is loaded: use the model's .safetensors file."
        )
    if not path.is_file():
        raise MissingWeights(f"Expected weights at {path}, found no file: check the path, or fetch them first.")
    return _open_npz(path) if path.suffix == ".npz" else _open_safetensors(path)


def _open_safetensors(path: Path) -> SafetensorsFile:
    try:
        with safetensors.safe_open(path, framework="numpy"):
            pass  # checks that the header is sound and that the arrays fill the file exactly
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            header = json.loads(file.read(length))
    except (safetensors.SafetensorError, OSError, ValueError) as problem:
        size = path.stat().st_size
        with path.open("rb") as file:
            start = file.read(2)
        if start == b"PK" or (start[:1] == b"\x80" and start[1:] in (b"\x02", b"\x03", b"\x04", b"\x05")):
            raise UnreadableWeights(
                f"Expected safetensors in {path}, got a PyTorch or pickle file under its name: use the model's .safetensors file."
            ) from None
        raise UnreadableWeights(
            f"Expected a complete safetensors file in {path}, got {size} bytes that are none ({problem}): fetch the file again."
        ) from None
    header.pop("__metadata__", None)
    strange = next((entry["dtype"] for entry in header.values() if entry["dtype"] not in _DTYPES), None)
    if strange:
        raise UnreadableWeights(f"Expected a dtype among {sorted(_DTYPES)}, got {strange} in {path}: convert the file.")
    return SafetensorsFile(
        path,
        {name: np.dtype(_DTYPES[entry["dtype"]]) for name, entry in header.items()},
        {name: tuple(entry["shape"]) for name, entry in header.items()},
        {name: 8 + length + entry["data_offsets"][0] for name, entry in header.items()},
    )


def _open_npz(path: Path) -> NpzFile:
    shapes, members = {}, {}
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.namelist():
                name = member.removesuffix(".npy").removeprefix("params/")
                with archive.open(member) as file:
                    version = np.lib.format.read_magic(file)
                    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                    shapes[name], _, dtype = read(file)
                if dtype.hasobject:
                    raise UnreadableWeights(
                        f"Expected plain arrays in {path}, got {name!r} as a pickle, which runs code when it is loaded: use another file."
                    )
                members[name] = member
    except (OSError, ValueError, zipfile.BadZipFile) as problem:
        raise UnreadableWeights(f"Expected a complete npz in {path}, got one that is not ({problem}): fetch the file again.") from problem
    return NpzFile(path, shapes, members)

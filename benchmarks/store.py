"""The store: checkpoints there and back, how long the optimisation waits for one, artifacts, beside the bare disk and the digest.

Every row is taken in turn with a plain write and read of as many random bytes and with their sha256, which any proven store must
pay. The error is whether what comes back is what went in, bit for bit; and of a file with one flipped bit, whether that is noticed.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.drawing import sheet
from benchmarks.timing import Times, take_turns
from storage.artifacts import get_artifact, put_artifact
from storage.checkpoints import CheckpointWriter, latest_checkpoint
from storage.contract import Store
from storage.digests import sha256_bytes
from storage.errors import DamagedArtifact
from storage.saver import AsyncSaver
from storage.store import open_store


@dataclass(frozen=True)
class Options:
    """megabytes: sizes of what is stored. rounds: of timing."""

    megabytes: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)
    rounds: int = 5


def run(options: Options) -> dict[str, Any]:
    """A row per size; the headline is the largest's."""
    rows = []
    for megabytes in options.megabytes:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(_measure(Path(folder), megabytes, options.rounds))
    last = rows[-1]
    rate = {name: round(last["megabytes"] / last["ways"][name]["wall_s"]["median"], 1) for name in last["ways"]}
    return {
        "headline": {
            "save_mb_per_s": rate["save"],
            "load_mb_per_s": rate["load"],
            "disk_write_mb_per_s": rate["disk write"],
            "waiting_share_of_save": round(
                1.0 / (last["ways"]["save"]["wall_s"]["median"] / last["ways"]["hand over"]["wall_s"]["median"]), 4
            ),
            "differences": sum(row["differences"] for row in rows),
            "damage_noticed": min(row["damage_noticed"] for row in rows),
        },
        "clock": "wall",
        "options": options.__dict__,
        "rows": rows,
    }


def _measure(folder: Path, megabytes: float, rounds: int) -> dict[str, Any]:
    """Floats of a normal distribution, as parameters and moments are; and as many bytes of them as a file."""
    rng = np.random.default_rng(0)
    arrays = {f"part{part}": rng.normal(size=int(megabytes * 1e6 / 16)).astype(np.float32) for part in range(4)}
    data = b"".join(array.tobytes() for array in arrays.values())
    store, bare = open_store(folder / "store"), folder / "bare"
    writer = CheckpointWriter(store, "save")
    steps = iter(range(1, 10**6))
    ref = put_artifact(store, "bytes", data, "application/octet-stream")
    saver = AsyncSaver(CheckpointWriter(store, "background"))
    handed = Times()

    def hand_over(turn: int) -> None:
        handed.add(partial(saver.save, next(steps), arrays))
        saver.wait()

    ways: dict[str, Callable[[int], Any]] = {
        "save": lambda turn: writer.save(next(steps), arrays) and None,
        "load": lambda turn: latest_checkpoint(store, "save") and None,
        "in background, waited for": hand_over,
        "put artifact": lambda turn: (
            put_artifact(store, "bytes", turn.to_bytes(8, "big") + os.urandom(8) + data, "application/octet-stream") and None
        ),
        "get artifact": lambda turn: get_artifact(store, ref) and None,
        "disk write": partial(_write, bare, data),
        "disk read": lambda turn: bare.read_bytes() and None,
        "digest": lambda turn: sha256_bytes(data) and None,
    }
    taken = take_turns(ways, rounds=rounds)
    handed.wall, handed.processor = handed.wall[1:], handed.processor[1:]  # less the round that warms up
    rows = {name: times.row() for name, times in (taken | {"hand over": handed}).items()}
    back = latest_checkpoint(store, "save")
    assert back is not None
    differences = sum(int(back.arrays[name].tobytes() != arrays[name].tobytes()) for name in arrays) + int(get_artifact(store, ref) != data)
    saver.close()
    return {"megabytes": len(data) / 1e6, "ways": rows, "differences": differences, "damage_noticed": int(notices_damage(store, data))}


def notices_damage(store: Store, data: bytes) -> bool:
    """Whether one flipped bit in a stored artifact is found when it is read."""
    ref = put_artifact(store, "damaged", b"to be damaged" + data[:1000], "application/octet-stream")
    stored = bytearray(store.get(ref.key))
    stored[len(stored) // 2] ^= 1
    store.put(ref.key, bytes(stored))
    try:
        get_artifact(store, ref)
    except DamagedArtifact:
        return True
    return False


def _write(path: Path, data: bytes, turn: int) -> None:
    """As durable as the store's own writes: on the disk before it counts."""
    with open(path, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def plot(result: dict[str, Any], path: Path) -> None:
    """Seconds against size."""
    with sheet(path) as panels:
        for name in result["rows"][0]["ways"]:
            panels[0].loglog(
                [row["megabytes"] for row in result["rows"]],
                [row["ways"][name]["wall_s"]["median"] for row in result["rows"]],
                "o:" if name in ("disk write", "disk read", "digest") else "o-",
                ms=4,
                label=name,
            )
        panels[0].set(xlabel="megabytes", ylabel="wall seconds", title="store")

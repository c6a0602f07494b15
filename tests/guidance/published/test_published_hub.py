"""Fetching, with the hub's real client against a hub on the loopback: once, resumed, verified, then without asking."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import plain_folder
import pytest
from fake_hub import COMMIT, Hub, served

from storage.digests import sha256_bytes
from storage.download import fetch
from storage.errors import StorageFull, StoreNotWritable, UnreadableWeights
from storage.published import NoNetwork, NotPublished, Offline, from_hub

REPO = Path(__file__).resolve().parents[3]

ASK = """
import json, sys
from tasks.published import find_published
try:
    found = find_published(sys.argv[1])
    print(json.dumps({"origin": found.files.origin, "digest": found.digest()}))
except Exception as problem:
    print(json.dumps({"error": type(problem).__name__, "text": str(problem)}))
"""


def start(name: str, hub: Hub, home: Path, **environment: str) -> subprocess.Popen[str]:
    """In a process of its own, since the hub's client reads its environment once."""
    settings = {"HF_ENDPOINT": hub.address, "HF_HOME": str(home), "HF_HUB_OFFLINE": "0", "HF_HUB_DISABLE_TELEMETRY": "1"} | environment
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", ASK, name], cwd=REPO, env=os.environ | settings, **pipes)


def ask(name: str, hub: Hub, home: Path, **environment: str) -> dict[str, str]:
    """What it answers in the end."""
    process = start(name, hub, home, **environment)
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return json.loads(out.splitlines()[-1])


def asked_ranges(hub: Hub) -> list[str | None]:
    return [asked for kind, path, asked in hub.asked if kind == "GET" and path.endswith(".safetensors")]


@pytest.fixture(scope="module")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Hub:
    settings = plain_folder.config(vision_config=plain_folder.CONFIG["vision_config"] | {"intermediate_size": 70000})
    folder = plain_folder.write(tmp_path_factory.mktemp("hub"), settings)
    return Hub({path.name: path.read_bytes() for path in folder.iterdir()})


def test_fetched_once_resumed_and_then_used_without_asking(hub: Hub, tmp_path: Path) -> None:
    hub.break_after = 12_000_000
    with served(hub):
        first = ask("good/model", hub, tmp_path)
        assert first["origin"] == f"good/model@{COMMIT}", first
        ranges = asked_ranges(hub)
        assert ranges[0] is None and ranges[1] is not None and not ranges[1].startswith("bytes=0")
        hub.asked.clear()
        assert ask("good/model", hub, tmp_path) == first
        assert not [path for _, path, _ in hub.asked if "resolve" in path]
    assert ask("good/model", hub, tmp_path, HF_HUB_OFFLINE="1") == first
    blob = next(path for path in (tmp_path / "hub").rglob("model.safetensors")).resolve()
    blob.write_bytes(blob.read_bytes()[:-1] + b"x")
    refused = ask("good/model", hub, tmp_path, HF_HUB_OFFLINE="1")
    assert refused["error"] == "UnreadableWeights" and "Expected digest" in refused["text"] and "fetch it again" in refused["text"]


def test_a_killed_download_goes_on_where_it_stopped(hub: Hub, tmp_path: Path) -> None:
    hub.stall_after = 12_000_000
    with served(hub):
        process = start("good/model", hub, tmp_path)
        while not (got := [path for path in tmp_path.rglob("*.part") if path.stat().st_size > 0]):
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)
        process.kill()
        process.communicate()
        size = got[0].stat().st_size
        hub.asked.clear()
        second = start("good/model", hub, tmp_path, TQDM_POSITION="-1")  # the client's bars, though nobody watches
        out, shown = second.communicate(timeout=120)
    assert json.loads(out.splitlines()[-1])["origin"] == f"good/model@{COMMIT}", shown
    assert asked_ranges(hub) == [f"bytes={size}-"] and 0 < size <= 12_000_000
    assert "model.safetensors: " in shown and "100%" in shown
    blob = next(tmp_path.rglob("model.safetensors")).resolve()
    assert blob.read_bytes() == hub.files["model.safetensors"] and not list(tmp_path.rglob("*.part"))


@pytest.mark.slow
def test_a_download_that_breaks_off_for_good_says_so_in_one_sentence(hub: Hub, tmp_path: Path) -> None:
    """The hub's client tries five times before it gives up, a second apart."""
    hub.mute = True
    with served(hub):
        refused = ask("good/model", hub, tmp_path)
    hub.mute = False
    assert refused["error"] == "NoNetwork" and "the download broke off" in refused["text"], refused
    assert "the next attempt goes on from there" in refused["text"] and "\n" not in refused["text"]


def test_no_network_no_repository_and_a_hub_that_lies(hub: Hub, tmp_path: Path) -> None:
    with served(hub):
        refused = ask("bad/model", hub, tmp_path)
        assert refused["error"] == "NotPublished" and "bad/model" in refused["text"]
        hub.lies = True
        refused = ask("good/model", hub, tmp_path / "lied")
        hub.lies = False
        assert refused["error"] == "UnreadableWeights" and "Expected digest" in refused["text"]
    refused = ask("good/other", hub, tmp_path / "fresh", HF_HUB_OFFLINE="1")
    assert refused["error"] == "Offline" and "HF_HUB_OFFLINE is set" in refused["text"], refused
    assert "use --guidance embedded" in refused["text"]


@pytest.mark.slow
def test_a_hub_that_does_not_answer(hub: Hub, tmp_path: Path) -> None:
    """Half a minute: the hub's client tries several times before it gives up."""
    hub.port = hub.port or 9
    refused = ask("good/other", hub, tmp_path)
    assert refused["error"] == "NoNetwork" and "the hub did not answer" in refused["text"], refused


def test_a_plain_address_is_fetched_once_resumed_and_remembered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "0")
    data = np.random.default_rng(0).bytes(5_000_000)
    seen: list[tuple[int, int | None]] = []
    with served(Hub({"LiT.npz": data}, break_after=3_000_000)) as hub:
        address = f"{hub.address}/good/LiT.npz"
        with pytest.raises(NoNetwork, match="got neither"):
            fetch(address, tmp_path, progress=lambda name, done, total: seen.append((done, total)))
        assert not (tmp_path / "LiT.npz").exists() and (tmp_path / "LiT.npz.part").stat().st_size == 3_000_000
        path = fetch(address, tmp_path, progress=lambda name, done, total: seen.append((done, total)))
        assert path.read_bytes() == data and seen[-1] == (5_000_000, 5_000_000)
        assert [asked for kind, _, asked in hub.asked] == [None, "bytes=3000000-"]
        fetch(address, tmp_path)
        assert len(hub.asked) == 2
        with pytest.raises(NotPublished, match="404"):
            fetch(f"{hub.address}/good/other.npz", tmp_path)
    path.write_bytes(data[:-1])
    with pytest.raises(UnreadableWeights, match=r"Expected digest .* remove it and .*\.sha256.*, then fetch"):
        fetch(address, tmp_path)
    with pytest.raises(NoNetwork, match="use --guidance embedded"):
        fetch(address, tmp_path / "elsewhere")
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    with pytest.raises(Offline, match="HF_HUB_OFFLINE is set"):
        fetch(address, tmp_path / "elsewhere")


def test_a_full_disk_under_the_hub_s_cache_is_said_to_be_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: object, **more: object) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("huggingface_hub.hf_hub_download", full)
    with pytest.raises(StorageFull, match=r"room for more at .*config.json, but the disk is full"):
        from_hub("good/model", [["config.json"]])


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Hub, str, bytes]]:
    """A hub, the address of a plain file on it, and its bytes."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "0")
    data = np.random.default_rng(0).bytes(3_000_000)
    with served(Hub({"LiT.npz": data})) as hub:
        yield hub, f"{hub.address}/good/LiT.npz", data


def test_one_at_a_time_fetches_a_plain_address(plain: tuple[Hub, str, bytes], tmp_path: Path) -> None:
    hub, address, data = plain
    begun, go_on = threading.Event(), threading.Event()

    def wait(name: str, done: int, total: int | None) -> None:
        begun.set()
        assert go_on.wait(60)

    both = [threading.Thread(target=fetch, args=(address, tmp_path), kwargs={"progress": wait}) for _ in range(2)]
    both[0].start()
    assert begun.wait(60)
    both[1].start()
    time.sleep(0.3)
    go_on.set()
    for thread in both:
        thread.join(60)
    assert len(hub.asked) == 1 and (tmp_path / "LiT.npz").read_bytes() == data


def test_a_fetched_file_is_never_without_its_digest(plain: tuple[Hub, str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, address, data = plain
    original = os.replace

    def last_deed(source: Path, target: Path) -> None:
        original(source, target)
        if Path(target).name == "LiT.npz":
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", last_deed)
    with pytest.raises(KeyboardInterrupt):
        fetch(address, tmp_path)
    assert (tmp_path / "LiT.npz").is_file() and (tmp_path / "LiT.npz.sha256").read_text() == f"{sha256_bytes(data)}\n"


def test_a_disk_that_takes_no_file_is_one_sentence(plain: tuple[Hub, str, bytes], tmp_path: Path) -> None:
    _, address, _ = plain
    (tmp_path / "LiT.npz.part").symlink_to("/dev/full")
    with pytest.raises(StorageFull, match=r"room for 3000000 bytes at .*LiT.npz, but the disk is full"):
        fetch(address, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreNotWritable, match="choose a folder"):
        fetch(address, tmp_path / "file")

"""Fetching, with the hub's real client against a hub on the loopback: once, resumed, verified, then without asking."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import plain_folder
import pytest
from fake_hub import COMMIT, Hub, served

from storage.download import fetch
from storage.errors import UnreadableWeights
from storage.published import NoNetwork, NotPublished

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
    assert refused["error"] == "NoNetwork" and "HF_HUB_OFFLINE is set" in refused["text"], refused
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

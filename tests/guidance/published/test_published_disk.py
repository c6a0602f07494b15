"""What of a published model is on disk already, and how much memory it takes when it is loaded."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import plain_folder
import published_models as made
import pytest
from safetensors.numpy import save_file

from dreamfields_core.guidance.registry import NAMES
from storage.errors import UnreadableWeights
from storage.mapped import map_arrays
from tasks.published import describe_models, find_published

REPO = Path(__file__).resolve().parents[3]


def test_a_file_is_mapped_and_not_held_twice(tmp_path: Path) -> None:
    """Reading a half-precision file array by array takes the room of its largest array, not of the file."""
    save_file({f"part{place}": np.ones((500, 1000), np.float16) for place in range(20)}, tmp_path / "model.safetensors")
    arrays = map_arrays([tmp_path / "model.safetensors"])
    tracemalloc.start()
    total = sum(float(arrays[name].sum(dtype=np.float32)) for name in arrays)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == 1e7 and peak < 3e6


LOAD = """
import resource, sys
import jax
from tasks.published import find_published, load_published
find_published(sys.argv[1]).digest(), jax.block_until_ready(jax.numpy.ones(3) + 1)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
model = load_published(sys.argv[1], towers=("image",))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, sum(leaf.nbytes for leaf in jax.tree.leaves(model.params)))
"""


def test_a_half_precision_model_is_loaded_without_doubling_it(tmp_path: Path) -> None:
    """Its own bytes, and for a moment one stack of its layers again: a third of it."""
    wide = {"hidden_size": 1024, "num_hidden_layers": 6, "intermediate_size": 4096}
    settings = plain_folder.config(vision_config=plain_folder.CONFIG["vision_config"] | wide)
    plain_folder.write(tmp_path, settings | {"vision_config": plain_folder.CONFIG["vision_config"]})
    shapes = plain_folder.shapes(settings)
    save_file({name: np.zeros(shape, np.float16) for name, shape in shapes.items()}, tmp_path / "model.safetensors")
    (tmp_path / "config.json").write_text(json.dumps(settings))
    done = subprocess.run([sys.executable, "-c", LOAD, str(tmp_path)], cwd=REPO, capture_output=True, text=True, check=True)
    kilobytes, held = map(int, done.stdout.split())
    assert held > 150e6 and kilobytes * 1024 < 1.9 * held


def put(cache: Path, repository: str, files: dict[str, bytes]) -> None:
    """Files where the hub's client would have left them."""
    folder = cache / f"models--{repository.replace('/', '--')}"
    for inner in ("snapshots/abc", "refs"):
        (folder / inner).mkdir(parents=True, exist_ok=True)
    (folder / "refs" / "main").write_text("abc")
    for name, data in files.items():
        (folder / "snapshots" / "abc" / name).write_bytes(data)


def test_a_model_is_on_disk_when_each_of_its_files_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its tokenizer, which lies in another repository, a model cannot be used offline; nor a LiT without its vocabulary."""
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path / "hub"))
    model = NAMES["clip-vit-b32"]

    def there() -> dict[str, int]:
        return {row["name"]: row["megabytes"] for row in describe_models() if row["on_disk"]}

    put(tmp_path / "hub", model.repository, {"open_clip_model.safetensors": bytes(2_000_000), "open_clip_config.json": b"{}"})
    assert there() == {}
    put(tmp_path / "hub", model.tokenizer or "", {"tokenizer.json": bytes(1_000_000)})
    assert there() == {"clip-vit-b32": 3}
    (tmp_path / "dreamfields-lit").mkdir()
    (tmp_path / "dreamfields-lit" / "LiT-B16B.npz").write_bytes(bytes(4_000_000))
    assert there() == {"clip-vit-b32": 3}
    (tmp_path / "dreamfields-lit" / "LiT-B16B.txt").write_bytes(b"[CLS]")
    assert there() == {"clip-vit-b32": 3, "lit-b16b": 4}


def test_a_repository_of_the_registry_is_the_model_of_its_short_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its configuration may leave the activation out; whoever gives the repository gets the model that was trained all the same."""
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path))
    model = NAMES["clip-vit-l14"]
    settings = {"model_cfg": {"embed_dim": 24, "vision_cfg": {"layers": 2, "width": 64}, "text_cfg": {"layers": 1}}}
    put(tmp_path, model.repository, {"open_clip_config.json": json.dumps(settings).encode(), "open_clip_model.safetensors": b"weights"})
    made.write_clip_tokenizer(tmp_path, *made.clip_vocabulary())
    put(tmp_path, model.tokenizer or "", {name: (tmp_path / name).read_bytes() for name in ("vocab.json", "merges.txt")})
    short, long = find_published("clip-vit-l14"), find_published(model.repository)
    assert short.arch.image.stack.activation == short.arch.text.stack.activation == "quick_gelu"
    assert long.arch == short.arch and long.digest() == short.digest()


def test_weights_that_are_not_the_ones_of_the_registry_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path))
    put(tmp_path, NAMES["clip-vit-b32"].repository, {"open_clip_config.json": b"{}", "open_clip_model.safetensors": b"others"})
    with pytest.raises(
        UnreadableWeights, match=r"Expected digest e6d1bd7789aa for open_clip_model.safetensors of timm/.*: remove .* and fetch"
    ):
        find_published("clip-vit-b32")


def test_digests_of_the_registry_are_digests() -> None:
    stated = [digest for model in NAMES.values() for digest in model.sha256.values()]
    assert len(stated) >= 3 and all(re.fullmatch("[0-9a-f]{64}", digest) for digest in stated) and len(set(stated)) == len(stated)

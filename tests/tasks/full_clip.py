"""CLIP B/32 in its real size, of random weights, where the hub's client would have put LAION's. It makes no object.

OpenAI's own has a digest in the registry, which random weights cannot have.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "guidance" / "published"))

import plain_folder
import published_models as made
from safetensors.numpy import save_file

from dreamfields_core.guidance.registry import NAMES

COMMIT = "c0ffee" + "0" * 34
MODEL = NAMES["clip-vit-b32-laion2b"]
HUB = {
    "projection_dim": 512,
    "vision_config": {"hidden_size": 768, "num_hidden_layers": 12, "intermediate_size": 3072, "image_size": 224, "patch_size": 32},
    "text_config": {"hidden_size": 512, "num_hidden_layers": 12, "intermediate_size": 2048, "vocab_size": 49408},
}
OPEN_CLIP = {
    "model_cfg": {
        "embed_dim": 512,
        "vision_cfg": {"image_size": 224, "layers": 12, "width": 768, "patch_size": 32},
        "text_cfg": {"context_length": 77, "vocab_size": 49408, "width": 512, "heads": 8, "layers": 12},
    },
    "preprocess_cfg": {},
}


def write(home: Path) -> Path:
    """The repository of `clip-vit-b32-laion2b` and that of its tokenizer, cached under `home`, the folder HF_HOME. Returns `home`."""
    files = home / "files"
    files.mkdir(parents=True)
    (files / "open_clip_config.json").write_text(json.dumps(OPEN_CLIP), encoding="utf-8")
    save_file(made.open_clip_arrays(plain_folder.arrays(HUB)), files / "open_clip_model.safetensors")
    made.write_clip_tokenizer(files, *made.clip_vocabulary())
    _cache(home, MODEL.repository, files, ("open_clip_config.json", "open_clip_model.safetensors"))
    assert MODEL.tokenizer
    _cache(home, MODEL.tokenizer, files, ("vocab.json", "merges.txt"))
    return home


def _cache(home: Path, repository: str, files: Path, names: tuple[str, ...]) -> None:
    """Blobs named by their sha256, a snapshot that links to them, and a branch that names the snapshot."""
    folder = home / "hub" / f"models--{repository.replace('/', '--')}"
    snapshot = folder / "snapshots" / COMMIT
    for path in (folder / "refs", folder / "blobs", snapshot):
        path.mkdir(parents=True)
    (folder / "refs" / "main").write_text(COMMIT)
    for name in names:
        with (files / name).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        (files / name).rename(folder / "blobs" / digest)
        (snapshot / name).symlink_to(folder / "blobs" / digest)


if __name__ == "__main__":
    print(f"HF_HOME={write(Path(sys.argv[1]).resolve())}")

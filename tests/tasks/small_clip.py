"""Small CLIPs of random weights in folders, as tests/guidance/published writes them."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "guidance" / "published"))

import plain_folder


def write(folder: Path, *, image_size: int = 32, dim: int = 24) -> Path:
    """config.json, model.safetensors, vocab.json and merges.txt; models of other sizes are other models."""
    image = plain_folder.CONFIG["vision_config"] | {"image_size": image_size}
    return plain_folder.write(folder, plain_folder.config(vision_config=image, projection_dim=dim))

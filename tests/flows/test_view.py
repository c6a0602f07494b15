"""The page in a dream's folder: what it says, and what it offers."""

from __future__ import annotations

import re

from flows.view import view_page

RESULT = {
    "caption": "a <b>red</b> mushroom",
    "preset": "draft",
    "seed": 7,
    "config_digest": "0123456789abcdef" * 4,
    "encoders": {"guidance": {"name": "embedded", "digest": "ab"}},
    "scores": {"embedded-judge": {"rank": 2, "pool": 153, "cosine": 0.31249}},
    "mesh": {"mesh": {"faces": 800, "watertight": True}},
}


def test_it_says_what_the_result_says_and_offers_what_is_there() -> None:
    page = view_page(RESULT, b"mesh", ["turntable.mp4", "mesh_lod1.glb", "mesh.glb", "turntable.webp", "field.safetensors"]).decode()
    assert "2 of 153 (cosine 0.312)" in page and "0123456789ab<" in page and "&lt;b&gt;red" in page and "<b>red" not in page
    assert re.findall(r'download="([^"]*)"', page) == ["mesh.glb", "mesh_lod1.glb", "turntable.mp4", "result.json"]
    assert 'src="./turntable.webp"' in page


def test_without_a_turntable_there_is_no_broken_picture() -> None:
    assert "<img" not in view_page(RESULT, b"mesh", ["mesh.glb"]).decode()

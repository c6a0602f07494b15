"""Captions from everywhere: the same lines and digests, and one sentence where there are none."""

from __future__ import annotations

import http.server
import json
import socketserver
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dreamfields_core.captions import CaptionError
from dreamfields_core.teaching import words
from dreamfields_core.teaching.language import parse
from storage.digests import sha256_bytes
from tasks import caption_sets
from tasks.caption_sets import captions_from, digest_of, draw
from tasks.coco import PUBLISHED, Published, object_centric, published_list

LINES = ["A red mug.", "Two  cats, asleep ", "AN OLD KEY"]
SOURCE = f"import os\nos.abort()\nshort = ['x']\nqueries = {LINES!r}  # 3\nqueries = [q.lower() for q in queries]\n"


def test_the_digest_is_of_normalised_lines_joined_by_newlines() -> None:
    assert digest_of(LINES) == sha256_bytes(b"a red mug.\ntwo  cats, asleep.\nan old key.")


def test_a_published_list_is_read_and_never_run() -> None:
    assert published_list(SOURCE) == LINES
    with pytest.raises(CaptionError, match="fetch it again"):
        published_list("<html>not found</html>")


@pytest.fixture
def publisher(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that is served, in which `few.py` is the published list called few-3."""
    folder = tmp_path / "published"
    folder.mkdir()
    handler = partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    monkeypatch.setattr(handler.func, "log_message", lambda *_: None)
    monkeypatch.setenv("DREAMFIELDS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HF_HUB_OFFLINE", "0")
    with socketserver.TCPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_address[1]}/few.py"
        monkeypatch.setitem(PUBLISHED, "few-3", Published(address, digest_of(LINES)))
        yield folder
        server.shutdown()


def test_a_published_set_is_fetched_once_and_verified(publisher: Path) -> None:
    (publisher / "few.py").write_text(SOURCE)
    first = captions_from("few-3")
    assert first.captions == ("A red mug.", "Two  cats, asleep", "AN OLD KEY") and first.digest == digest_of(LINES)
    assert first.pool == ("a red mug.", "two  cats, asleep.", "an old key.")
    (publisher / "few.py").unlink()
    assert captions_from("few-3") == first


def test_other_captions_under_the_published_name_are_refused(publisher: Path) -> None:
    (publisher / "few.py").write_text(SOURCE.replace("mug", "cup"))
    with pytest.raises(CaptionError, match=r"digest differs\): remove the file"):
        captions_from("few-3")


def test_offline_the_published_set_is_one_sentence_with_the_way_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DREAMFIELDS_CACHE", str(tmp_path))
    with pytest.raises(CaptionError, match=r"or a network to fetch it .*: put the file there, or use embedded:12") as refused:
        captions_from("coco")
    assert str(refused.value).count("\n") == 0


def annotations() -> tuple[dict, dict]:
    """Pictures 1 and 4 show one object; 2 shows two, 3 none, 5 is a close up in somebody's words, 6 is a crowd."""
    said = [(1, 11, "A red\nmug "), (1, 10, "a mug"), (2, 12, "two cups"), (3, 13, "a field"), (4, 9, "a key"), (5, 14, "a rose")]
    said += [(5, 15, "An extreme close-up of a rose"), (6, 16, "people")]
    boxes = [(1, 0), (2, 0), (2, 0), (4, 0), (5, 0), (6, 1)]
    return (
        {
            "images": [{"id": image, "file_name": f"{image:012}.jpg"} for image in range(1, 7)],
            "annotations": [{"image_id": image, "id": number, "caption": caption} for image, number, caption in said],
        },
        {"annotations": [{"image_id": image, "id": number, "iscrowd": crowd} for number, (image, crowd) in enumerate(boxes)]},
    )


def test_the_object_centric_subset_has_one_box_no_close_up_and_one_caption_a_picture() -> None:
    assert list(object_centric(*annotations())) == [("a mug", "000000000001.jpg"), ("a key", "000000000004.jpg")]
    with pytest.raises(CaptionError, match="give its annotation files"):
        list(object_centric({"images": []}, annotations()[1]))


def test_annotation_files_are_read_and_pictures_found_beside_them(tmp_path: Path) -> None:
    (tmp_path / "annotations").mkdir()
    for name, value in zip(("captions", "instances"), annotations()):
        (tmp_path / "annotations" / f"{name}_val.json").write_text(json.dumps(value))
    source = f"coco:{tmp_path}/annotations/captions_val.json"
    assert captions_from(source).captions == ("a mug", "a key") and captions_from(source).pictures == {}
    (tmp_path / "val").mkdir()
    assert captions_from(source).pictures["a key"] == tmp_path / "val" / "000000000004.jpg"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.txt", "# ours\na red mug\n\n an old key \na red mug\n"),
        ("a.csv", "number,Caption,picture\n1,a red mug,mug.png\n2,an old key,\n"),
        ("a.csv", "a red mug\nan old key\n"),
        ("a.json", '["a red mug", "an old key"]'),
        ("a.json", '{"captions": [{"caption": "a red mug", "picture": "mug.png"}, "an old key"]}'),
    ],
)
def test_files_of_captions(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_bytes(b"\xef\xbb\xbf" + text.encode())
    found = captions_from(str(tmp_path / name))
    assert found.captions == ("a red mug", "an old key") and found.name == name
    assert found.pictures == ({"a red mug": tmp_path / "mug.png"} if "mug.png" in text else {})


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("a.txt", b"\n\n", "at least one caption"),
        ("a.txt", b"\xff\xfe\x00", "save it as UTF-8"),
        ("a.txt", b"a\ttab", "one line"),
        ("a.csv", b"", "at least one caption"),
        ("a.csv", b"number,caption\n1,a red mug\n\n2\n", "a caption in row 4 of"),
        ("a.json", b"{", "expected JSON"),
        ("a.json", b'{"lines": []}', "a list of captions"),
        ("a.json", b'["a mug", 3]', "item 2"),
        ("a.yaml", b"- a mug", "expected captions from coco"),
        ("captions_val.json", b"[]", "expected COCO's annotations"),
    ],
)
def test_bad_files_are_one_sentence(tmp_path: Path, name: str, data: bytes, sentence: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CaptionError, match=sentence) as refused:
        captions_from(("coco:" if name.startswith("captions_") else "") + str(tmp_path / name))
    assert len(str(refused.value)) < 400 and "\n" not in str(refused.value)


@pytest.mark.parametrize("source", ["missing.txt", "coco:val.json", "embedded:0", "embedded:99999", "embedded:x", ""])
def test_what_is_no_source_says_what_is(source: str) -> None:
    with pytest.raises(CaptionError, match="expected"):
        captions_from(source)


def test_the_embedded_language_covers_every_kind_and_is_the_same_for_a_seed() -> None:
    found = captions_from("embedded:40:3")
    assert len(set(found.captions)) == 40 and found.spoken and found.pool == ()
    assert {parse(caption).thing.kind for caption in found.captions} == set(words.KINDS)
    assert found.captions == captions_from("embedded:40:3").captions != captions_from("embedded:40:4").captions
    few = [parse(caption).thing.kind for caption in draw(np.random.default_rng(0), 8)]
    assert len(set(few)) == 8


def test_a_set_that_the_language_does_not_hold_is_its_own_pool() -> None:
    assert caption_sets.CaptionSet("two", ("a red mug", "A bust of Nefertiti")).pool == ("a red mug.", "a bust of nefertiti.")

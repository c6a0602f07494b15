"""Object Centric COCO (paper section 5.1 and its supplement): the published captions, and the same kind of subset from COCO's own files."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dreamfields_core.captions import CaptionError

LEFT_OUT = ("close up", "closeup", "cropped", "collage", "blurry")
"""Phrases of captions whose pictures do not show one whole object as it looks; the paper names "extreme close up" among others."""


@dataclass(frozen=True)
class Published:
    """A list of captions that somebody else published. sha256: of the normalised lines joined by newlines."""

    address: str
    sha256: str


PUBLISHED = {
    "coco": Published(
        "https://raw.githubusercontent.com/google-research/google-research/4c4299485319ed72ef782020c81784be5468924e/"
        "dreamfields/dreamfields/config/coco_queries_val.py",
        "f0fb740e8dded740d1b8a54ba09c81080499c99e6db11a3a3133c0e3842d9747",
    )
}


def published_list(source: str) -> list[str]:
    """The longest list of texts that a Python source states; nothing of it is run.

    Raises: CaptionError.
    """
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except SyntaxError as problem:
        raise CaptionError(f"expected a published list of captions, got a text that is none ({problem.msg}): fetch it again") from None
    lists = [node.elts for node in nodes if isinstance(node, ast.List)]
    texts = [[item.value for item in items if isinstance(item, ast.Constant) and isinstance(item.value, str)] for items in lists]
    return max((found for found, items in zip(texts, lists) if len(found) == len(items)), key=len, default=[])


def object_centric(captions: Mapping[str, Any], instances: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(caption, file name of the picture) of every picture with a single bounding box, one caption each, in the order of the pictures' ids.

    A picture is left out if any of its captions has one of the phrases: what one writer calls a close up is one.

    Args:
      captions, instances: COCO's captions_*.json and instances_*.json.

    Raises: CaptionError.
    """
    try:
        boxes = Counter(instance["image_id"] for instance in instances["annotations"])
        crowds = {instance["image_id"] for instance in instances["annotations"] if instance.get("iscrowd")}
        files = {image["id"]: str(image["file_name"]) for image in captions["images"]}
        said: dict[int, list[str]] = {}
        for annotation in sorted(captions["annotations"], key=lambda annotation: annotation["id"]):
            said.setdefault(annotation["image_id"], []).append(" ".join(str(annotation["caption"]).split()))
    except (KeyError, TypeError) as problem:
        raise CaptionError(f"expected COCO's captions and instances, got files without {problem}: give its annotation files") from None
    for image in sorted(said):
        alone = boxes[image] == 1 and image not in crowds
        if alone and image in files and not any(map(_is_left_out, said[image])):
            yield said[image][0], files[image]


def _is_left_out(caption: str) -> bool:
    words = " ".join(re.findall(r"[a-z]+", caption.lower()))
    return any(re.search(rf"\b{phrase}\b", words) for phrase in LEFT_OUT)

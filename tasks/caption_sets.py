"""Many captions from one source: a published set, COCO's annotations, a file, or the language of the embedded models."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dreamfields_core import captions
from dreamfields_core.captions import CaptionError
from dreamfields_core.teaching import words
from dreamfields_core.teaching.language import Description, describe, parse
from dreamfields_core.teaching.pools import meaning, random_description
from storage.digests import sha256_bytes
from storage.download import fetch
from storage.errors import StorageError
from storage.published import NoNetwork, Offline
from tasks.coco import PUBLISHED, object_centric, published_list
from tasks.compiled import cache_folder

SOURCES = "coco (the paper's 153), embedded:COUNT or embedded:COUNT:SEED, coco:captions_*.json, or a .txt, .csv or .json file"
MOST = 5000
"""Captions drawn from the embedded language at most: it ends somewhere."""


@dataclass(frozen=True)
class CaptionSet:
    """name: of the source. captions: as they are dreamed, none twice. pictures: caption -> a true picture of it, where there are any.

    spoken: whether all are of the embedded models' language, for which the judge has pools of its own.
    """

    name: str
    captions: tuple[str, ...]
    pictures: dict[str, Path] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """sha256 of the normalised lines joined by newlines."""
        return digest_of(self.captions)

    @property
    def spoken(self) -> bool:
        return all(understood(caption) for caption in self.captions)

    @property
    def pool(self) -> tuple[str, ...]:
        """The captions among which the judge must find the true one, normalised as the paper does it; none where the language has pools."""
        return () if self.spoken else tuple(captions.normalize(caption) for caption in self.captions)


def captions_from(source: str) -> CaptionSet:
    """The captions of a source, checked.

    Args:
      source: one of SOURCES.

    Raises: CaptionError.
    """
    kind, _, rest = source.partition(":")
    if source in PUBLISHED:
        return _checked(source, _fetched(source))
    if kind == "embedded" and re.fullmatch(r"\d+(:\d+)?", rest):
        count, _, seed = rest.partition(":")
        return _checked(source, draw(np.random.default_rng(int(seed or 0)), int(count)))
    if kind == "coco" and rest:
        return _from_coco(source, Path(rest).expanduser())
    path = Path(source).expanduser()
    if path.suffix not in READERS:
        raise CaptionError(f'expected captions from {SOURCES}, got "{source[:80]}"')
    rows = READERS[path.suffix](_text(path), path)
    return _checked(path.name, [caption for caption, _ in rows], {caption: path.parent / picture for caption, picture in rows if picture})


def draw(rng: np.random.Generator, count: int) -> list[str]:
    """Random captions of the embedded language, of different meaning; every kind of thing is there once before any is there twice.

    Raises: CaptionError.
    """
    if not 1 <= count <= MOST:
        raise CaptionError(f"expected from 1 to {MOST} captions of the embedded language, got {count}: write for instance embedded:12")
    found: dict[tuple, Description] = {}
    kinds: list[str] = []
    while len(found) < count:
        kinds = kinds or rng.permutation(list(words.KINDS)).tolist()
        description = random_description(rng, held_out=None)
        if description.thing.kind == kinds[-1] and description.thing.color and meaning(description) not in found:
            found[meaning(description)] = description
            kinds.pop()
    return list(map(describe, found.values()))


def understood(caption: str) -> Description | None:
    """What a caption says in the embedded language; None outside it."""
    try:
        return parse(caption)
    except ValueError:
        return None


def digest_of(lines: Sequence[str]) -> str:
    """sha256 of the normalised captions joined by newlines."""
    return sha256_bytes("\n".join(map(captions.normalize, lines)).encode())


def _checked(name: str, lines: Sequence[str], pictures: dict[str, Path] | None = None) -> CaptionSet:
    """Each caption once and fit to be dreamed; the pictures follow theirs."""
    said = {line: captions.check(line) for line in lines if line.strip()}
    if not said:
        raise CaptionError(f"expected at least one caption in {name}, got none: write one a line")
    return CaptionSet(
        name, tuple(dict.fromkeys(said.values())), {said[line]: path for line, path in (pictures or {}).items() if line in said}
    )


def _fetched(name: str) -> list[str]:
    entry = PUBLISHED[name]
    path = cache_folder() / "captions" / entry.address.rsplit("/", 1)[-1]
    try:
        fetch(entry.address, path.parent)
    except (NoNetwork, Offline) as error:
        raise CaptionError(
            f"expected {path}, or a network to fetch it from {entry.address}, got neither: put the file there, or use embedded:12"
        ) from error
    except StorageError as error:
        raise CaptionError(f"{str(error)[:1].lower()}{str(error)[1:]}".rstrip(".")) from error
    lines = published_list(path.read_text(encoding="utf-8", errors="replace"))
    if digest_of(lines) != entry.sha256:
        raise CaptionError(
            f"expected the captions of {name} in {path}, got others (their digest differs): remove the file and fetch it again"
        )
    return lines


def _from_coco(name: str, path: Path) -> CaptionSet:
    """Pictures are found where COCO keeps them: the folder of the split, beside that of the annotations."""
    if not path.name.startswith("captions_"):
        raise CaptionError(f"expected coco:FOLDER/captions_*.json with instances_*.json beside it, got {path}: name COCO's captions file")
    said, boxes = _json(path), _json(path.with_name("instances_" + path.name.removeprefix("captions_")))
    rows = list(object_centric(said, boxes))
    folder = path.parent.parent / path.stem.removeprefix("captions_")
    return _checked(name, [caption for caption, _ in rows], {caption: folder / file for caption, file in rows} if folder.is_dir() else {})


Rows = list[tuple[str, str | None]]
"""(caption, picture's path as the file says it)."""


def _plain(text: str, path: Path) -> Rows:
    return [(line, None) for line in text.splitlines() if not line.startswith("#")]


def _columns(text: str, path: Path) -> Rows:
    """The columns caption and picture; without such a heading, the first column."""
    rows = [(number, row) for number, row in enumerate(csv.reader(io.StringIO(text)), 1) if row]
    heading = [cell.strip().lower() for cell in rows[0][1]] if rows else []
    if "caption" not in heading:
        return [(row[0], None) for _, row in rows]
    cells = {number: dict(zip(heading, row)) for number, row in rows[1:]}
    for number, row in cells.items():
        if "caption" not in row:
            raise CaptionError(f"expected a caption in row {number} of {path}, got a row that is too short for one: complete it")
    return [(row["caption"], row.get("picture") or None) for row in cells.values()]


def _structured(text: str, path: Path) -> Rows:
    """A list of texts, or of objects with caption and perhaps picture; or an object that has such a list as its captions."""
    found = _parsed(text, path)
    items = found.get("captions") if isinstance(found, dict) else found
    if not isinstance(items, list):
        raise CaptionError(f'expected a list of captions in {path}, got {type(found).__name__}: write ["a red mug", ...]')
    rows: list[Any] = [(item.get("caption"), item.get("picture")) if isinstance(item, dict) else (item, None) for item in items]
    for number, (caption, picture) in enumerate(rows, 1):
        if not isinstance(caption, str) or not isinstance(picture, str | None):
            raise CaptionError(
                f"expected a text, or an object with a caption, as item {number} of {path}, got {str(items[number - 1])[:60]}"
            )
    return rows


READERS: dict[str, Callable[[str, Path], Rows]] = {".txt": _plain, ".csv": _columns, ".json": _structured}


def _json(path: Path) -> dict[str, Any]:
    found = _parsed(_text(path), path)
    if not isinstance(found, dict):
        raise CaptionError(f"expected COCO's annotations in {path}, got a {type(found).__name__}: give its annotation files")
    return found


def _parsed(text: str, path: Path) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as problem:
        raise CaptionError(f"expected JSON in {path}, got a text that is none ({problem}): correct it") from None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as problem:
        raise CaptionError(f"expected a file of captions at {path}, got '{problem.strerror}': check the path") from None
    except UnicodeDecodeError:
        raise CaptionError(f"expected UTF-8 text in {path}, got other bytes: save it as UTF-8") from None

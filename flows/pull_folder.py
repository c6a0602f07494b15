"""What a pull's folder holds: the manifest, what each object's own folder says, and what goes when the store has it no more."""

from __future__ import annotations

import json
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from flows.order import OrderError
from flows.pull_object import ABOUT, SAFE, about_bytes
from flows.slugs import slug
from storage.contract import Store
from storage.local import write_file
from storage.steps import record_key

MANIFEST = "manifest.json"


def read_manifest(folder: Path) -> dict[str, dict[str, Any]]:
    """Name of an object -> its facts and files; empty where there is none."""
    try:
        return dict(json.loads((folder / MANIFEST).read_bytes())["objects"])
    except FileNotFoundError:
        return {}
    except (ValueError, KeyError, TypeError):
        raise OrderError(f"expected a manifest of a pull, got {folder / MANIFEST}: remove it, and pull again") from None


def write_manifest(folder: Path, objects: dict[str, dict[str, Any]]) -> None:
    """The same objects give the same bytes, whenever they were pulled."""
    data = about_bytes({"manifest": 1, "objects": objects})
    path = folder / MANIFEST
    if not path.is_file() or path.read_bytes() != data:
        write_file(path, data)


def said(folder: Path) -> dict[str, dict[str, Any]]:
    """What each object's folder says of itself, those that the manifest has let go among them."""
    found = {}
    for path in sorted(folder.glob(f"*/{ABOUT}")):
        with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            about = json.loads(path.read_bytes())
            if path.parent.name == slug(about["caption"], about["record"]):  # else somebody's copy
                found[path.parent.name] = {"store": about["store"], "record": about["record"], "files": dict(about["files"])}
    return found


def gone(
    objects: dict[str, dict[str, Any]], store: Store, records: Container[str], damaged: Container[str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The objects that this store had and has no more; one whose record is there, but cannot be read, is not gone.

    records: keys of the dreams that are there. damaged: the store's keys of records that cannot be read.
    """
    for name, about in objects.items():
        if about["store"] == store.url and about["record"] not in records and record_key("dream", about["record"]) not in damaged:
            yield name, about


def remove(place: Path, about: dict[str, Any]) -> None:
    """Our own files only; the folder goes when nothing else is in it."""
    if not SAFE.fullmatch(place.name) or not place.is_dir():
        return
    for name in filter(SAFE.fullmatch, [*about["files"], ABOUT]):
        (place / name).unlink(missing_ok=True)
    if not any(place.iterdir()):
        place.rmdir()

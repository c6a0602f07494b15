"""The commands about finished objects: mesh again, and pull."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from flows.order import OrderError, address_of
from storage.errors import StorageError

MeshSettings = Annotated[list[str] | None, typer.Option("--set", metavar="mesh.KEY=VALUE", help="Change a setting; may be repeated.")]
Formats = Annotated[list[str] | None, typer.Option("--format", help="glb (the default), obj, ply, stl or usdz; may be repeated.")]
ADDRESS = "Folder or s3://bucket/prefix"


class Refused(StorageError):
    """Objects that could not be pulled; the text names them."""


def mesh(
    run: Annotated[str, typer.Argument(help="A dream's folder, or its record's key (or the beginning of it) or its caption in the store.")],
    faces: Annotated[int | None, typer.Option(help="Budget of faces.")] = None,
    texture: Annotated[int | None, typer.Option(help="Side of the texture in texels; 0 for colours of the vertices only.")] = None,
    formats: Formats = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the files; by default one named after the dream.")] = None,
    store: Annotated[str | None, typer.Option(help=f"{ADDRESS}; of a folder, its own; $DREAMFIELDS_STORE, else dreams/store.")] = None,
    settings: MeshSettings = None,
) -> None:
    """Mesh a stored dream again with other settings; it is not dreamed again."""
    from flows.remesh import remesh

    changes = list(settings or ())
    if faces is not None:
        changes.append(f"mesh.faces={faces}")
    if texture is not None:
        changes.append(f"mesh.texture={texture or 'null'}")
    for path in remesh(run, store=store, formats=formats or ["glb"], settings=changes, out=out):
        typer.echo(path)


def pull(
    to: Annotated[Path, typer.Option(help="Folder that is brought up to date; it gets manifest.json.")] = Path("assets"),
    formats: Formats = None,
    also: Annotated[list[str] | None, typer.Option(help="A further file of each dream, such as turntable.mp4; may be repeated.")] = None,
    caption: Annotated[str | None, typer.Option(help="Only captions with this text in them.")] = None,
    seed: Annotated[int | None, typer.Option(help="Only this seed.")] = None,
    min_score: Annotated[float | None, typer.Option(help="Only from this cosine on, by the dream's own judge.")] = None,
    since: Annotated[str | None, typer.Option(metavar="DATE", help="Only what was made then or later, such as 2026-11-21 (UTC).")] = None,
    sweep: Annotated[str | None, typer.Option(help="Only the dreams of this sweep.")] = None,
    prune: Annotated[bool, typer.Option("--prune", help="Delete the files of objects that the store no longer has.")] = False,
    store: Annotated[str | None, typer.Option(help=f"{ADDRESS}; $DREAMFIELDS_STORE, else dreams/store.")] = None,
) -> None:
    """Bring a folder up to date with the dreams of a store: verified by digest, only what changed."""
    from flows.pull import Only, pull

    only = Only(caption, seed, min_score, None if since is None else moment(since), sweep)
    signs = {"added": "+", "changed": "~", "removed": "-"}
    result = pull(
        address_of(store, Path("dreams")),
        to,
        formats=formats or ["glb"],
        also=also or (),
        only=only,
        prune=prune,
        told=lambda what, name: typer.echo(f"{signs[what]} {name}") if what in signs else None,
    )
    typer.echo(
        f"{len(result.added)} added, {len(result.changed)} changed, {len(result.removed)} removed, {len(result.same)} as before, "
        f"{result.moved / 1e6:.1f} MB: {result.manifest}"
    )
    for name, sentence in result.refused.items():
        typer.echo(f"refused {name}: {sentence}", err=True)
    if result.refused:
        raise Refused(f"expected every object to be whole, but {len(result.refused)} are not: {', '.join(result.refused)[:300]}")


def moment(text: str) -> datetime:
    """A date or a time in ISO 8601, UTC unless it says otherwise. Raises: OrderError."""
    try:
        parsed = datetime.fromisoformat(text)
    except ValueError:
        raise OrderError(f'expected a date such as 2026-11-21 or 2026-11-21T18:00, got "{text}": write it so') from None
    return parsed if parsed.tzinfo else parsed.replace(tzinfo=UTC)


def register(app: typer.Typer) -> None:
    """Give the commands to the command line."""
    app.command(epilog='Example: dreamfields mesh "a red mushroom" --faces 5000 --texture 2048 --format usdz --out mushroom')(mesh)
    app.command(epilog="Example: dreamfields pull --store s3://studio/dreams --to assets --format glb --format usdz --min-score 0.3")(pull)

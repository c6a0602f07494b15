"""The pull, conducted by Prefect: nightly for instance, after a sweep."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from prefect import flow
from prefect.artifacts import create_table_artifact
from prefect.logging import get_run_logger
from pydantic import Field

from flows.dream import Seed
from flows.pull import Only, pull

Place = Annotated[str, Field(min_length=1)]
Format = Literal["glb", "obj", "ply", "stl", "usdz"]
FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}$", description="of a dream's files, such as turntable.mp4")]
Cosine = Annotated[float, Field(ge=-1, le=1)]


class PullIncomplete(RuntimeError):
    """Some objects could not be brought, the others were; the text names them."""


@flow(name="pull", flow_run_name="to {to}", persist_result=False)
def pull_assets(
    store: Place,
    to: Place = "assets",
    formats: list[Format] | None = None,
    also: list[FileName] | None = None,
    caption: str | None = None,
    seed: Seed | None = None,
    min_score: Cosine | None = None,
    since: datetime | None = None,
    sweep: str | None = None,
    prune: bool = False,
) -> dict[str, Any]:
    """Bring a folder up to date with the dreams of a store; the run fails where an object is damaged, after all others are brought.

    Args:
      store: folder or s3://bucket/prefix.
      to: folder that gets the objects and manifest.json.
      formats: glb (the default), obj, ply, stl, usdz.
      also: further files of each dream, such as turntable.mp4.
      caption: only captions with this text in them.
      seed: only this seed.
      min_score: only from this cosine on.
      since: only what was made then or later; UTC, unless it says otherwise.
      sweep: only the dreams of this sweep.
      prune: delete the files of objects that the store no longer has.

    Returns:
      Names of objects by what became of them, bytes moved, and the manifest.
    """
    only = Only(caption, seed, min_score, since, sweep)
    result = pull(store, to, formats=formats or ["glb"], also=also or (), only=only, prune=prune)
    changes = [(what, name) for what in ("added", "changed", "removed", "refused") for name in getattr(result, what)]
    get_run_logger().info("%d changes, %d objects as before, %d bytes: %s", len(changes), len(result.same), result.moved, result.manifest)
    create_table_artifact([{"what": what, "object": name} for what, name in changes], key="pull-changes", description=f"Pulled to {to}")
    for name, sentence in result.refused.items():
        get_run_logger().error("refused %s: %s", name, sentence)
    if result.refused:
        raise PullIncomplete(f"expected every object to be whole, but {len(result.refused)} are not: {', '.join(result.refused)[:300]}")
    return {**vars(result), "manifest": str(result.manifest)}

"""The pull, conducted by Prefect: nightly for instance, after a sweep."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from prefect import flow
from prefect.artifacts import create_table_artifact
from prefect.logging import get_run_logger

from flows.pull import Only, pull


@flow(name="pull", flow_run_name="to {to}", persist_result=False)
def pull_assets(
    store: str,
    to: str = "assets",
    formats: list[str] | None = None,
    also: list[str] | None = None,
    caption: str | None = None,
    seed: int | None = None,
    min_score: float | None = None,
    since: datetime | None = None,
    sweep: str | None = None,
    prune: bool = False,
) -> dict[str, Any]:
    """Bring a folder up to date with the dreams of a store.

    Args:
      store: folder or s3://bucket/prefix.
      to: folder that gets the objects and manifest.json.
      formats: glb (the default), obj, ply, stl, usdz.
      also: further files of each dream, such as turntable.mp4.
      caption: only captions with this text in them.
      seed: only this seed.
      min_score: only from this cosine on.
      since: only what was made then or later.
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
    return {**vars(result), "manifest": str(result.manifest)}

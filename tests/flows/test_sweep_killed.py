"""A sweep on a server and a worker that are killed with -9 and started again: nothing finished is done twice, the scores are the same."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from flows.sweep_record import members, sweeps
from storage.contract import Store
from storage.steps import find_record
from storage.store import open_store
from tests.flows.site import Site, wait_for
from tests.tasks.processes import Process
from tests.tasks.tiny import SETTINGS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(3600),
    pytest.mark.skipif(sys.platform != "linux", reason="looks at processes through /proc"),
]
CAPTIONS, SEEDS, VARIANTS = "embedded:2", [0], ["90 degrees", "360 degrees"]
OBJECTS = 4
LONGEST = 1200.0
"""Seconds for all of them, on a busy machine."""


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    (tmp_path / "site").mkdir()
    site = Site(tmp_path / "site")
    yield site
    site.close()


def swept(site: Site, out: Path, **more: Any) -> Any:
    """Ask for the sweep; its flow run."""
    wishes = {"captions": CAPTIONS, "table": "cameras", "variants": VARIANTS, "seeds": SEEDS, "settings": list(SETTINGS)}
    return site.run("coco-sweep/coco-sweep", **wishes, out=str(out), **more)


def finished_steps(store: Store) -> dict[str, bytes]:
    """The log of executed steps: each leaves a record with the moment and the time it took, which doing it again would change."""
    steps = ("encode", "optimize", "views", "render", "mesh", "score", "mesh_score", "dream")
    return {key: store.get(key) for step in steps for key in store.list(f"artifacts/{step}")}


def dreams(store: Store) -> int:
    return len(store.list("artifacts/dream"))


def scores(store: Store) -> dict[tuple[str, str, int], Any]:
    """By variant, caption and seed."""
    (record,) = sweeps(store)
    found = {(one.variant, one.caption, one.seed): find_record(store, "dream", str(one.key)) for one in members(record)}
    return {name: record and record.values["scores"] for name, record in found.items()}


def test_killed_twice_a_sweep_ends_with_the_same_scores_and_no_finished_step_is_done_again(site: Site, tmp_path: Path) -> None:
    out, store = tmp_path / "killed", open_store(tmp_path / "killed" / "store")
    swept(site, out)
    wait_for(lambda: dreams(store) >= 1, LONGEST)
    wait_for(site.optimizers, LONGEST)
    site.kill(site.worker)
    seen = [finished_steps(store)]

    site.worker = site.start_worker()
    swept(site, out)
    wait_for(lambda: dreams(store) >= 2, LONGEST)
    site.kill(site.server)
    seen.append(finished_steps(store))
    site.server = site.start_server()

    last = swept(site, out)
    wait_for(lambda: site.state(last) in ("Completed", "Failed", "Crashed"), LONGEST)
    assert site.state(last) == "Completed" and dreams(store) == OBJECTS
    seen.append(finished_steps(store))
    for earlier in seen[:2]:
        assert earlier.items() <= seen[-1].items(), "a finished step was done again"

    runs, begun = len(site.runs("dream")), time.monotonic()
    again = swept(site, out)
    wait_for(lambda: site.state(again) in ("Completed", "Failed", "Crashed"), LONGEST)
    print(f"second run: {time.monotonic() - begun:.1f} s with the start of its process, as a user sees it")
    assert site.state(again) == "Completed" and len(site.runs("dream")) == runs
    assert finished_steps(store) == seen[-1]
    assert len(list(out.glob("*.html"))) == 1

    lost = store.list("artifacts/dream")[0]
    store.delete(lost)
    pooled = swept(site, out, through="pool")
    wait_for(lambda: site.state(pooled) in ("Completed", "Failed", "Crashed"), LONGEST)
    assert site.state(pooled) == "Completed" and dreams(store) == OBJECTS
    assert len(site.runs("dream")) == runs + 1, "only what was missing is a run of its own"
    assert {key: data for key, data in seen[-1].items() if key != lost}.items() <= finished_steps(store).items()

    settings = [text for setting in SETTINGS for text in ("--set", setting)]
    plain = Process("flows.cli", "sweep", CAPTIONS, "--table", "cameras", "--variants", ",".join(VARIANTS), "--seeds", "0", *settings,
                    "--out", str(tmp_path / "plain"))  # fmt: skip
    assert plain.end() == 0, plain.text()
    assert scores(open_store(tmp_path / "plain" / "store")) == scores(store)

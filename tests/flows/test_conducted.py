"""The same steps as Prefect tasks: the store decides what is done, the page shows what came of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from prefect import flow
from prefect.artifacts import Artifact
from prefect.exceptions import ParameterTypeError
from prefect.flows import load_flow_from_entrypoint
from prefect.states import State
from prefect.testing.utilities import prefect_test_harness

from dreamfields_core.captions import LONGEST, normalize
from dreamfields_core.config import DreamConfig
from flows.dream import dream
from storage.store import open_store
from tasks.conducted import as_task, record_of
from tasks.step import Made, Place, Step, Work, is_done, perform
from tests.flows.conftest import CAPTION, Dreams
from tests.tasks.processes import REPO
from tests.tasks.tiny import SETTINGS

PAGE = ("dream-views", "dream-score", "dream-summary")


@pytest.fixture(scope="module")
def server() -> Iterator[None]:
    with prefect_test_harness(server_startup_timeout=120):
        yield


def cook(work: Work) -> Made:
    """A step of no time."""
    return Made((work.keep("dish.txt", work.text("what").encode(), "text/plain"),))


@pytest.mark.usefixtures("server")
def test_a_lost_artifact_is_a_miss_for_prefect_too(tmp_path: Path) -> None:
    step, place, config = Step("cook", 1, ("mesh",), cook), Place(open_store(tmp_path)), DreamConfig()

    @flow
    def kitchen() -> State:
        known = is_done(step, place, config, {"what": "soup"})
        cooking: State = as_task(step, place)(config, {"what": "soup"}, return_state=True)  # type: ignore[assignment]
        states.append((known, str(cooking.name)))
        return None  # type: ignore[return-value]

    states: list[tuple[bool, str]] = []
    kitchen()
    kitchen()
    place.store.delete(next(key for key in place.store.list("blobs")))
    kitchen()
    kitchen()
    assert states == [(False, "Completed"), (True, "Cached"), (False, "Completed"), (True, "Cached")]


@pytest.mark.usefixtures("server")
def test_each_store_answers_for_itself(tmp_path: Path) -> None:
    cooked: list[str] = []

    def improvise(work: Work) -> Made:
        cooked.append("dish")
        return Made((work.keep("dish.txt", f"{work.text('what')} {len(cooked)}".encode(), "text/plain"),))

    step, config, inputs = Step("improvise", 1, ("mesh",), improvise), DreamConfig(), {"what": "soup"}
    one, other = (Place(open_store(tmp_path / name)) for name in ("one", "other"))

    @flow
    def kitchen() -> None:
        first = record_of(as_task(step, one)(config, inputs))
        theirs = perform(step, other, config, inputs).record
        assert record_of(as_task(step, other)(config, inputs)) == theirs != first
        assert record_of(as_task(step, one)(config, inputs)) == first

    kitchen()
    assert len(cooked) == 2


@pytest.mark.usefixtures("server")
def test_what_the_plain_command_made_is_there_for_the_flow(again: Dreams) -> None:
    result = dream(CAPTION, settings=list(SETTINGS), store=str(again.out / "store"), out=str(again.out))
    _, plain, _ = again.dream()
    assert result["artifacts"] == plain["artifacts"] and result["scores"] == plain["scores"]
    found = {key: Artifact.get(key) for key in PAGE}
    assert all(found.values())
    assert str(found["dream-views"].data).startswith("data:image/webp;base64,")  # type: ignore[union-attr]
    assert "embedded-judge" in str(found["dream-score"].data)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "wrong",
    [
        {"caption": ""},
        {"caption": "a" * 10_000},
        {"caption": CAPTION, "preset": "hgih"},
        {"caption": CAPTION, "seed": -1},
        {"caption": CAPTION, "settings": ["mesh.faces"]},
        {},
    ],
)
def test_parameters_are_refused_before_a_run(wrong: dict) -> None:
    with pytest.raises((ParameterTypeError, TypeError)):
        dream.validate_parameters(wrong) if "caption" in wrong else dream(**wrong)


def test_captions_to_choose_from_may_be_longer_than_what_is_dreamed() -> None:
    candidates = [normalize("a" * LONGEST), normalize("İ" * LONGEST)]
    assert dream.validate_parameters({"caption": CAPTION, "among": candidates})["among"] == candidates


def test_the_deployments_lead_to_flows() -> None:
    deployments = yaml.safe_load((REPO / "prefect.yaml").read_text())["deployments"]
    for deployment in deployments:
        assert load_flow_from_entrypoint(str(REPO / deployment["entrypoint"])).name == deployment["name"]

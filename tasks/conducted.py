"""A step as a Prefect task. Prefect is given the step's key as its cache key, and the store's record, as JSON, as its result;
whether a step is done is asked of the store alone, never of Prefect's cache: a lost file is a miss, another store another answer, and a
wiped database loses no work.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from prefect import Task, task
from prefect.context import TaskRunContext
from prefect.states import Completed, State

from dreamfields_core.config import DreamConfig
from storage.steps import StepRecord
from tasks.retries import DELAYS, is_passing
from tasks.step import Input, Place, Step, key_of, perform

TaskResult = Any
"""A record as JSON, or Prefect's state around one."""


def as_task(step: Step, place: Place) -> Task[..., TaskResult]:
    """The task that does the step at that place; called with (config, inputs)."""

    def cache_key(context: TaskRunContext, arguments: dict[str, Any]) -> str:
        return f"{step.name}-{key_of(step, arguments['config'], arguments['inputs'])}"

    @task(
        name=step.name,
        cache_key_fn=cache_key,
        refresh_cache=True,
        persist_result=True,
        result_serializer="json",
        retries=len(DELAYS),
        retry_delay_seconds=list(DELAYS),
        retry_condition_fn=_try_again,
    )
    def do(config: DreamConfig, inputs: Mapping[str, Input]) -> TaskResult:
        done = perform(step, place, config, inputs)
        record = done.record.to_json()
        return Completed(name="Cached", data=record, message="was done already") if done.cached else record

    return do


def _try_again(task: Any, run: Any, state: State) -> bool:
    return is_passing(state.data)


def record_of(result: TaskResult) -> StepRecord:
    """What a task's result says, state or record."""
    while isinstance(result, State):
        result = result.result()
    return StepRecord.from_json(result)

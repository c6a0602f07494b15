"""text embedding -> field: the long step, in a process of its own that saves whatever way it is stopped."""

from __future__ import annotations

from storage.artifacts import ArtifactRef
from tasks.child import Child, ChildError
from tasks.step import Event, Made, Work

WORKER = "tasks.optimize_worker"


class OptimizeError(RuntimeError):
    """The field could not be optimised; the text is one sentence with the way out."""


class OptimizeInterrupted(OptimizeError):
    """What the process needed did not answer; another try may find it (tasks/retries.py)."""


class OptimizeStopped(OptimizeError):
    """Somebody else has stopped the process; nothing is lost."""


def optimize(work: Work) -> Made:
    """Start the child, listen, and whatever happens here leave none behind.

    Raises: OptimizeError, OptimizeInterrupted, OptimizeStopped, ChildError.
    """
    child = Child(WORKER, _job(work))
    last: Event = {"event": "silent"}
    try:
        with work.place.stop.on_request(child.terminate):
            for last in child.events():
                work.place.report(last)
    except ChildError as error:
        if last["event"] != "failed":
            if child.told_to_end:  # nobody wants another try
                raise OptimizeStopped(str(error)) from None
            raise
    except BaseException:
        work.place.report(child.stop() or last)
        raise
    finally:
        child.close()
    return _made(last)


def _job(work: Work) -> Event:
    embedding = work.inputs["text_embedding"]
    assert isinstance(embedding, ArtifactRef)
    return {
        "store": work.place.store.url,
        "run": f"optimize-{work.key}",
        "config": work.config.model_dump(mode="json"),
        "text_embedding": embedding.to_json(),
        "preview": str(work.place.preview.absolute()) if work.place.preview else None,
    }


def _made(last: Event) -> Made:
    if last["event"] == "done":
        return Made(tuple(ArtifactRef.from_json(ref) for ref in last["outputs"]), last["values"], last["seconds"])
    if last["event"] == "failed":
        raise (OptimizeInterrupted if last["passing"] else OptimizeError)(last["text"])
    if last["event"] == "stopped":
        raise OptimizeStopped("expected the optimisation to finish, but its process was told to stop: the same command goes on from there")
    raise ChildError(
        f"expected the optimisation to say how it ended, but the last it said was {last['event']!r}: run the same command again"
    )

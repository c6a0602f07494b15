"""Teaches the image-text models that ship with the project: pictures, then lessons, then an examination.

    python -m flows.train_embedded --model guide        makes storage/embedded/guide.safetensors; killed, it goes on where it was
    python -m flows.train_embedded --model guide --lengthen   goes on from the shipped weights with the terms that they have not had
    python -m flows.train_embedded --evaluate guide     what the shipped weights know

`train_embedded` is the same as a Prefect flow.
"""

from __future__ import annotations

import argparse
import io
import json
import logging
import time
from pathlib import Path

import jax
import numpy as np
from prefect import flow
from safetensors.numpy import save

from dreamfields_core.guidance import embedded
from dreamfields_core.teaching import lessons, report
from dreamfields_core.teaching.album import Page, training_page
from dreamfields_core.teaching.batches import Class
from dreamfields_core.teaching.courses import COURSES
from dreamfields_core.teaching.terms import Course
from dreamfields_core.types import Encoder
from storage.local import write_file
from storage.weights import read_weights

WEIGHTS = Path(__file__).parent.parent / "storage" / "embedded"
WORK = Path(".cache/embedded")
SAVE_EVERY = 100
log = logging.getLogger(__name__)


class OtherCourse(ValueError):
    """A checkpoint of other lessons than those that are asked for; its text is one sentence with the way out."""


@flow(name="train-embedded", flow_run_name="{model}", persist_result=False)
def train_embedded(model: str, work: str = str(WORK), weights: str = str(WEIGHTS)) -> str:
    """Makes the weights of one of the models that ship, conducted by Prefect.

    Args:
      model: guide or judge.
      work: folder of pictures and checkpoints; what is there already is not made again.
      weights: folder that gets <model>.safetensors.

    Returns:
      The file of the weights.
    """
    return str(train(model, Path(work), Path(weights)))


def train(model: str, work: Path = WORK, weights: Path = WEIGHTS, *, lengthen: bool = False) -> Path:
    """Makes the album, teaches the course, writes the weights; each part only as far as it is not there yet. Needs no Prefect server.

    Args:
      lengthen: where there is no checkpoint, go on from the weights that are there, instead of from nothing.

    Raises:
      OtherCourse: a checkpoint, or the weights to go on from, are not of this course.
    """
    course, checkpoint = COURSES[model], work / f"{model}.npz"
    if lengthen and not checkpoint.exists():
        keep(checkpoint, course, go_on(course, weights / f"{model}.safetensors"))
    album = make_album(course, work / "pages")
    taught = teach(model, course, album, checkpoint)
    return write_weights(taught, course, weights / f"{model}.safetensors")


def go_on(course: Course, path: Path) -> lessons.Progress:
    """The first step of the terms that the weights of a file have not had. Raises: OtherCourse."""
    read = read_weights(path)
    had = {course.taught_by(step): step for step in course.starts}
    step = had.get(read.metadata.get("taught_by", ""))
    if step is None:
        raise OtherCourse(f"expected weights that end a term of this course, got {path}, which another has taught: teach it from the start")
    return lessons.begin_term(course, step, embedded.model_from_arrays(path.stem, read.arrays, read.metadata).params)


def make_album(course: Course, folder: Path) -> Page:
    """All captioned pictures of a course, from disk where they have been made before."""
    pages = [load_page(course.seed, number, folder) for number in range(course.pages)]
    return Page(np.concatenate([page.pictures for page in pages]), [caption for page in pages for caption in page.captions])


def load_page(seed: int, number: int, folder: Path) -> Page:
    """One page, made and kept where it is missing."""
    path = folder / f"{seed}-{number:04d}.npz"
    if not path.exists():
        started = time.monotonic()
        page = training_page(seed, number)
        write_arrays(path, pictures=page.pictures, captions=np.array(page.captions))
        log.info("page %d of seed %d: %.0f pictures a second", number, seed, len(page.captions) / (time.monotonic() - started))
    with np.load(path) as stored:
        return Page(stored["pictures"], [str(caption) for caption in stored["captions"]])


def teach(name: str, course: Course, album: Page, checkpoint: Path) -> embedded.Model:
    """Takes the course from its newest checkpoint to its end."""
    model, progress = lessons.begin(course)
    progress = restore(checkpoint, course, progress)
    pupils = Class(course, album.pictures, album.captions, model.architecture)
    step = lessons.make_step(course, model.architecture)
    started, told = time.monotonic(), []
    for number in range(int(progress.step), course.steps):
        progress, said = step(lessons.enter_term(course, progress), pupils.batch(number))
        told.append(said)
        if (number + 1) % SAVE_EVERY == 0 or number + 1 == course.steps:
            report_progress(name, course, number + 1, told, time.monotonic() - started)
            keep(checkpoint, course, progress)
            started, told = time.monotonic(), []
    return lessons.taught(model, progress)


def report_progress(name: str, course: Course, step: int, told: list[dict], seconds: float) -> None:
    """Says how it goes, and stops what no longer learns."""
    means = {key: round(float(np.mean([float(said[key]) for said in told])), 3) for key in told[0]}
    if not np.isfinite(means["contrast"]):
        raise FloatingPointError(f"expected a finite loss of {name!r}, got {means} at step {step}: lower the course's learning rate")
    log.info("%s %d/%d %s, %.0f pictures a second", name, step, course.steps, json.dumps(means), course.batch * len(told) / seconds)


def keep(path: Path, course: Course, progress: lessons.Progress) -> None:
    """Writes a checkpoint, with what it was taught by; the old one stays until the new one is whole."""
    taught_by = np.array(course.taught_by(int(progress.step)))
    write_arrays(path, *(np.asarray(leaf) for leaf in jax.tree.leaves(progress)), taught_by=taught_by)


def restore(path: Path, course: Course, fresh: lessons.Progress) -> lessons.Progress:
    """The checkpoint, or `fresh` where there is none. Raises: OtherCourse."""
    if not path.exists():
        return fresh
    old, tree = jax.tree.flatten(fresh)
    with np.load(path) as stored:
        taught_by = str(stored["taught_by"]) if "taught_by" in stored.files else None
        leaves = [jax.numpy.asarray(stored[name]) for i in range(len(old)) if (name := f"arr_{i}") in stored.files]
    if len(leaves) != len(old) or taught_by != course.taught_by(int(leaves[0])):
        raise OtherCourse(f"expected a checkpoint of this course, got {path}, which another has taught: move it away to begin anew")
    return jax.tree.unflatten(tree, leaves)


def write_weights(model: embedded.Model, course: Course, path: Path, *, step: int | None = None) -> Path:
    """The model in half precision, with all that is needed to use it, and what taught it: the whole course, or its first `step` steps."""
    arrays, metadata = embedded.to_arrays(model)
    write_file(path, save(arrays, metadata | {"taught_by": course.taught_by(course.steps if step is None else step)}))
    return path


def load(path: Path) -> Encoder:
    """The encoder that a file holds."""
    read = read_weights(path)
    return embedded.from_arrays(path.stem, read.arrays, read.metadata, read.sha256)


def write_arrays(path: Path, *numbered: np.ndarray, **named: np.ndarray) -> None:
    """Arrays as one npz file, of which nothing half-written is ever visible."""
    file = io.BytesIO()
    np.savez(file, *numbered, **named)  # type: ignore[arg-type]
    write_file(path, file.getvalue())


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", choices=COURSES, help="teach this model")
    parser.add_argument("--evaluate", metavar="NAME", help="examine the shipped weights of this name")
    parser.add_argument("--so-far", metavar="NAME", choices=COURSES, help="write the weights of the newest checkpoint")
    parser.add_argument("--work", type=Path, default=WORK, help="folder of pictures and checkpoints (default: %(default)s)")
    parser.add_argument("--weights", type=Path, default=WEIGHTS, help="folder of the weights (default: %(default)s)")
    parser.add_argument("--lengthen", action="store_true", help="with --model: without a checkpoint, go on from the shipped weights")
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", force=True)  # the conductor has set its own
    if not (arguments.model or arguments.evaluate or arguments.so_far):
        parser.error("say what to do: --model NAME teaches, --evaluate NAME examines")
    if arguments.model:
        print(train(arguments.model, arguments.work, arguments.weights, lengthen=arguments.lengthen))
    if name := arguments.so_far:
        course = COURSES[name]
        model, fresh = lessons.begin(course)
        progress = restore(arguments.work / f"{name}.npz", course, fresh)
        file = arguments.weights / f"{name}.safetensors"
        print(write_weights(lessons.taught(model, progress), course, file, step=int(progress.step)))
    if arguments.evaluate:
        print(json.dumps(report.examine(load(arguments.weights / f"{arguments.evaluate}.safetensors")), indent=2))


if __name__ == "__main__":
    try:
        main()
    except OtherCourse as error:
        raise SystemExit(str(error)) from None

"""Lessons teach, and a course that was stopped goes on as if it had not been."""

from __future__ import annotations

import shutil
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dreamfields_core.teaching import album, contrast, lessons, spoiling
from dreamfields_core.teaching.batches import Class
from dreamfields_core.teaching.terms import Course, Term
from flows import train_embedded
from storage.weights import read_weights, shipped

TINY = {"image_size": 16, "dim": 16, "fine": 8, "coarse": 16, "fine_blocks": 1, "coarse_blocks": 1, "text_width": 16, "text_blocks": 1}
COURSE = Course(
    seed=3,
    sizes=TINY,
    batch=16,
    terms=(Term(24, 1e-2, last=0.3), Term(6, 1e-3, radius=1.0, ramp=2, alike=4)),
    replays=3,
    pages=1,
)


@pytest.fixture(scope="module")
def page() -> album.Page:
    return album.training_page(3, 0, n=24, size=16)


@pytest.fixture(scope="module")
def taught(page: album.Page):
    """(state after every step, reports)."""
    model, progress = lessons.begin(COURSE)
    pupils = Class(COURSE, page.pictures, page.captions, model.architecture)
    step = lessons.make_step(COURSE, model.architecture)
    states, reports = [progress], []
    for number in range(COURSE.steps):
        progress, report = step(lessons.enter_term(COURSE, progress), pupils.batch(number))
        states.append(progress)
        reports.append(report)
    return states, reports, step, pupils


def test_lessons_lower_the_loss(taught) -> None:
    _, reports, _, _ = taught
    first, last = (np.mean([float(r["facts"]) for r in part]) for part in (reports[:4], reports[20:24]))
    assert last < 0.93 * first


def test_a_course_resumed_from_disk_is_the_same_to_the_bit(taught, tmp_path) -> None:
    states, _, step, pupils = taught
    middle = COURSE.starts[1] + 1  # within a replayed batch, so that the perturbation has to be kept too
    train_embedded.keep(tmp_path / "state.npz", COURSE, states[middle])
    progress = train_embedded.restore(tmp_path / "state.npz", COURSE, lessons.begin(COURSE)[1])
    for number in range(middle, COURSE.steps):
        progress, _ = step(lessons.enter_term(COURSE, progress), pupils.batch(number))
    jax.tree.map(np.testing.assert_array_equal, progress, states[-1])


FIRST, SECOND = COURSE.terms
THIRD = Term(10, 1e-3)


@pytest.mark.parametrize(
    ("step", "changes", "goes_on"),
    [
        (30, {"terms": (FIRST, SECOND, THIRD)}, True),
        (30, {"pages": 2}, True),
        (24, {"terms": (FIRST, replace(SECOND, rate=1e-4))}, True),
        (25, {"terms": (FIRST, replace(SECOND, rate=1e-4))}, False),
        (30, {"terms": (FIRST,)}, False),
        (30, {"terms": (FIRST, replace(SECOND, steps=5))}, False),
        (30, {"terms": (replace(FIRST, last=0.2), SECOND, THIRD)}, False),
        (24, {"terms": (replace(FIRST, rate=1e-3), SECOND)}, False),
        (3, {"replays": 2}, False),
        (3, {"sizes": TINY | {"coarse": 8}}, False),
    ],
)
def test_a_checkpoint_goes_on_only_in_the_course_that_taught_it(taught, tmp_path, step: int, changes: dict, goes_on: bool) -> None:
    path, other = tmp_path / "state.npz", replace(COURSE, **changes)
    train_embedded.keep(path, COURSE, taught[0][step])
    fresh = lessons.begin(COURSE)[1]
    if goes_on:
        assert int(train_embedded.restore(path, other, fresh).step) == step
    else:
        with pytest.raises(train_embedded.OtherCourse, match="move it away"):
            train_embedded.restore(path, other, fresh)


def test_a_checkpoint_that_does_not_say_what_taught_it_is_refused(taught, tmp_path) -> None:
    path = tmp_path / "state.npz"
    train_embedded.write_arrays(path, *(np.asarray(leaf) for leaf in jax.tree.leaves(taught[0][3])))
    with pytest.raises(train_embedded.OtherCourse, match="move it away"):
        train_embedded.restore(path, COURSE, taught[0][0])


def test_robust_lessons_replay_their_batch_and_move_its_pictures(taught) -> None:
    states, _, _, pupils = taught
    start = COURSE.starts[1]
    batches = [pupils.batch(start + i) for i in range(4)]
    np.testing.assert_array_equal(batches[0].tokens, batches[2].tokens)
    assert not np.array_equal(batches[0].tokens, batches[3].tokens)
    lengths = jnp.sqrt((states[-1].perturbation ** 2).sum((1, 2, 3)))
    assert 0 < float(lengths.max()) <= COURSE.terms[1].radius + 1e-5


def test_a_share_of_the_pictures_stays_clean(page) -> None:
    course = replace(COURSE, terms=(Term(3, 1e-3, radius=1.0, clean=0.5),))
    model, progress = lessons.begin(course)
    pupils = Class(course, page.pictures, page.captions, model.architecture)
    step, moved = lessons.make_step(course, model.architecture), []
    for number in range(3):
        progress, _ = step(progress, pupils.batch(number))
        moved.append(np.sqrt((progress.perturbation**2).sum((1, 2, 3))) > 1e-5)
    np.testing.assert_array_equal(*moved[1:])  # a replayed picture keeps its lot; the first step's radius is still 0
    assert 0.2 < moved[-1].mean() < 0.8


def test_a_term_begins_with_the_averaged_weights_as_they_ship(taught) -> None:
    states = taught[0]
    entered = lessons.enter_term(COURSE, states[COURSE.starts[1]])
    shipped = jax.tree.map(lambda leaf: np.float32(np.float16(leaf)), states[COURSE.starts[1]].average["model"])
    jax.tree.map(np.testing.assert_array_equal, entered.params["model"], shipped)
    assert all(not np.any(leaf) for leaf in jax.tree.leaves(entered.optimizer))
    assert lessons.enter_term(COURSE, states[5]) is states[5]


def test_a_step_belongs_to_one_term() -> None:
    assert [COURSE.term_of(step)[1] for step in (0, 23, 24, 29)] == [0, 23, 0, 5]
    assert COURSE.steps == 30
    rates = [float(lessons.rate_of(COURSE)(step)) for step in range(COURSE.steps)]
    assert max(rates[:24]) == pytest.approx(1e-2)
    assert max(rates[24:]) == pytest.approx(1e-3)


def test_pictures_of_a_group_differ_in_kind_alone(page) -> None:
    colors = ["red", "blue"]
    captions = [f"a {color} {kind}" for color in colors for kind in ("cube", "cone", "egg", "mug", "star", "tree")]
    pupils = Class(COURSE, page.pictures[:12], captions, lessons.begin(COURSE)[0].architecture)
    rng, grouped, single = np.random.default_rng(0), Term(1, 1e-3, alike=4), Term(1, 1e-3)
    for _ in range(20):
        groups = pupils._choose(rng, grouped).reshape(-1, 4) // 6
        assert (groups == groups[:, :1]).all()
    assert len({tuple(pupils._choose(rng, single) // 6) for _ in range(5)}) > 1


def test_a_term_may_show_two_things_at_once_more_often_than_they_come(page) -> None:
    captions = ["a red cube on top of a blue cone", "a red egg on top of a blue mug", *["a red cube", "a red cone"] * 10]
    pupils = Class(COURSE, page.pictures[:22], captions, lessons.begin(COURSE)[0].architecture)
    rng, shares = np.random.default_rng(0), {}
    for pairs in (0.0, 0.5, 1.0):
        term = Term(1, 1e-3, alike=2, pairs=pairs)
        shares[pairs] = np.mean([pupils._choose(rng, term)[::2] < 2 for _ in range(100)])
    assert shares[1.0] == 1
    assert shares[0.0] == pytest.approx(2 / 22, abs=0.04)
    assert shares[0.5] == pytest.approx(0.5 + 0.5 * 2 / 22, abs=0.06)


def test_a_flow_run_writes_weights_that_load(page, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(train_embedded.COURSES, "tiny", COURSE)
    monkeypatch.setattr(train_embedded, "training_page", lambda seed, number: page)
    path = train_embedded.train("tiny", tmp_path / "work", tmp_path / "weights")
    encoder = train_embedded.load(path)
    assert (encoder.name, encoder.image_size, encoder.dim) == ("tiny", 16, 16)
    assert [p.name for p in (tmp_path / "weights").iterdir()] == ["tiny.safetensors"]


def test_a_longer_course_goes_on_from_the_weights_as_from_the_checkpoint(page, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(train_embedded, "training_page", lambda seed, number: page)
    short = replace(COURSE, terms=(FIRST,))
    monkeypatch.setitem(train_embedded.COURSES, "tiny", short)
    train_embedded.train("tiny", tmp_path / "work", tmp_path / "weights")
    monkeypatch.setitem(train_embedded.COURSES, "tiny", replace(COURSE, terms=(FIRST, THIRD)))
    shutil.copytree(tmp_path / "weights", tmp_path / "others")
    lengthened = train_embedded.train("tiny", tmp_path / "elsewhere", tmp_path / "others", lengthen=True)
    resumed = train_embedded.train("tiny", tmp_path / "work", tmp_path / "weights")
    one, other = read_weights(lengthened), read_weights(resumed)
    assert one.metadata == other.metadata
    jax.tree.map(np.testing.assert_array_equal, one.arrays, other.arrays)


def test_weights_of_another_course_are_not_gone_on_from(page, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(train_embedded, "training_page", lambda seed, number: page)
    monkeypatch.setitem(train_embedded.COURSES, "tiny", replace(COURSE, terms=(FIRST,)))
    weights = train_embedded.train("tiny", tmp_path / "work", tmp_path)
    monkeypatch.setitem(train_embedded.COURSES, "tiny", replace(COURSE, seed=4))
    before = weights.read_bytes()
    with pytest.raises(train_embedded.OtherCourse, match="from the start"):
        train_embedded.train("tiny", tmp_path / "new", tmp_path, lengthen=True)
    assert weights.read_bytes() == before


@pytest.mark.parametrize("name", train_embedded.COURSES)
def test_what_ships_has_had_its_whole_course(name: str) -> None:
    course = train_embedded.COURSES[name]
    assert read_weights(shipped(name)).metadata["taught_by"] == course.taught_by(course.steps)


def test_contrast_forgives_captions_of_the_same_meaning() -> None:
    vectors = jnp.eye(4)
    same = vectors.at[1].set(vectors[0])
    meanings, wrong = jnp.array([1, 1, 2, 3]), jnp.array([9, 9, 9, 9])
    forgiven = contrast.contrast(same, same, -vectors, -vectors[:1], meanings, wrong, jnp.log(50.0))
    charged = contrast.contrast(same, same, -vectors, -vectors[:1], jnp.arange(4), wrong, jnp.log(50.0))
    assert float(forgiven) < 1e-3 < 0.1 < float(charged)


def test_a_perturbation_stays_in_its_ball() -> None:
    moved = jnp.zeros((2, 4, 4, 3))
    for seed in range(5):
        moved = contrast.toward_ball(moved, jax.random.normal(jax.random.key(seed), moved.shape), jnp.float32(0.5))
    np.testing.assert_array_less(jnp.sqrt((moved**2).sum((1, 2, 3))), 0.5 + 1e-5)


def test_spoiled_pictures_are_pictures() -> None:
    pictures = jnp.zeros((12, 16, 16, 4)).at[:, 4:12, 4:12].set(1.0)
    images = spoiling.spoil(jax.random.key(0), pictures)
    assert images.shape == (12, 16, 16, 3)
    assert float(images.min()) >= 0
    assert float(images.max()) <= 1
    assert np.isfinite(images).all()


def test_an_unspoilt_lens_shows_what_is_there() -> None:
    pictures = jax.random.uniform(jax.random.key(0), (1, 16, 16, 4))
    place = jnp.arange(16)[None, :] + 0.5 - 8
    lens = spoiling._lens(place, jnp.full((1, 1), 0.05), 16)
    np.testing.assert_allclose(jnp.einsum("bih,bhwc,bjw->bijc", lens, pictures, lens), pictures, atol=1e-4)

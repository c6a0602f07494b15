"""Which descriptions are taught, which are held out, and the pools that retrieval chooses from."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from dreamfields_core.teaching import words
from dreamfields_core.teaching.language import Description, Thing

HELD_OUT = 0.12
"""Share of the attribute combinations that no training picture shows."""


def is_held_out(description: Description) -> bool:
    """Whether this combination of kinds, colours, patterns and relation is kept from training, by a hash that never changes.

    Sizes do not count, and a caption that leaves a colour open is always taught.
    """
    things = [thing for thing in (description.thing, description.other) if thing]
    if any(thing.color is None for thing in things):
        return False
    text = "|".join([str(description.relation), *(f"{t.kind},{t.color},{t.pattern},{t.part_color}" for t in things)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big") < HELD_OUT * 2**32


def random_description(rng: np.random.Generator, *, held_out: bool | None = False) -> Description:
    """A description; `held_out` says from which side of the split (None: from both).

    What stands next to something is held out only if no lesson shows it the other way round either.
    """
    while True:
        description = _draw(rng)
        if held_out is None or (is_held_out(description) == held_out and not (held_out and _taught_mirrored(description))):
            return description


def _taught_mirrored(description: Description) -> bool:
    """Whether lessons show the same scene under its other name: the hash reads the two things in order, a picture does not."""
    if description.relation != "next to" or description.other is None:
        return False
    return not is_held_out(replace(description, thing=description.other, other=description.thing))


def _draw(rng: np.random.Generator) -> Description:
    """36 % plain, 4 % without a colour, 10 % sized, 18 % patterned, 14 % part-coloured, 18 % relations."""
    form = rng.random()
    kind, color = _choice(rng, words.KINDS), _choice(rng, words.COLORS)
    if form < 0.36:
        return Description(Thing(kind, color))
    if form < 0.40:
        return Description(Thing(kind))
    if form < 0.50:
        return Description(Thing(kind, color, size=_choice(rng, words.SIZES)))
    if form < 0.68:
        return Description(Thing(kind, color, pattern=_choice(rng, words.PATTERNS)))
    if form < 0.82:
        kind = _choice(rng, words.PARTS)
        taken = {color, words.PARTS[kind][1]}
        return Description(Thing(kind, color, part_color=_choice(rng, [other for other in words.COLORS if other not in taken])))
    first, second = (words.RELATABLE[i] for i in rng.choice(len(words.RELATABLE), 2, replace=False))
    return Description(Thing(first, color), _choice(rng, words.RELATIONS), Thing(second, _choice(rng, words.COLORS)))


def _choice(rng: np.random.Generator, names: Iterable[Any]) -> Any:
    options = list(names)
    return options[rng.integers(len(options))]


def hard_negative(rng: np.random.Generator, description: Description) -> Description:
    """The description with one attribute changed: the wrong caption that is hardest to tell from the right one."""
    while True:
        changed = _CHANGES[rng.integers(len(_CHANGES))](rng, description)
        if meaning(changed) != meaning(description):
            return changed


def _change_kind(rng: np.random.Generator, description: Description) -> Description:
    thing = description.thing
    if description.other is None:
        return replace(description, thing=replace(thing, kind=_choice(rng, words.PARTS if thing.part_color else words.KINDS)))
    which = "thing" if rng.random() < 0.5 else "other"
    return replace(description, **{which: replace(getattr(description, which), kind=_choice(rng, words.RELATABLE))})


def _change_color(rng: np.random.Generator, description: Description) -> Description:
    which = "other" if description.other and rng.random() < 0.5 else "thing"
    thing = getattr(description, which)
    field = "part_color" if thing.part_color and rng.random() < 0.5 else "color"
    if getattr(thing, field) is None:
        return description
    return replace(description, **{which: replace(thing, **{field: _choice(rng, words.COLORS)})})


def _change_structure(rng: np.random.Generator, description: Description) -> Description:
    """Swaps what belongs to which: the part's colour and the body's, the two things, the relation, the pattern, the size."""
    thing, other = description.thing, description.other
    if other is not None:
        form = rng.integers(3)
        if form == 0:
            return replace(description, relation=_choice(rng, words.RELATIONS))
        if form == 1:
            return replace(description, thing=replace(thing, color=other.color), other=replace(other, color=thing.color))
        return replace(description, thing=other, other=thing)
    if thing.part_color:
        return replace(description, thing=replace(thing, color=thing.part_color, part_color=thing.color))
    if thing.size:
        return replace(description, thing=replace(thing, size="small" if thing.size == "large" else "large"))
    if thing.pattern:
        return replace(description, thing=replace(thing, pattern=_choice(rng, [None, *words.PATTERNS])))
    return replace(description, thing=replace(thing, pattern=_choice(rng, words.PATTERNS))) if thing.color else description


_Change = Callable[[np.random.Generator, Description], Description]
_CHANGES: tuple[_Change, ...] = (_change_kind, _change_kind, _change_color, _change_structure)


def meaning(description: Description) -> tuple:
    """What two captions share when no picture could tell them apart ('next to' reads the same both ways)."""
    things = [tuple(str(v) for v in vars(t).values()) for t in (description.thing, description.other) if t]
    return (str(description.relation), *(sorted(things) if description.relation == "next to" else things))


def hard_pool(description: Description, n: int, *, seed: int = 0) -> list[Description]:
    """`n` descriptions with the same colours, patterns and relation but other kinds; fewer where the language has no more."""
    rng, seen, pool = np.random.default_rng(seed), {meaning(description)}, []
    for _ in range(50 * n):
        other = description
        for which in ("thing", "other"):
            thing = getattr(description, which)
            if thing is not None:
                kinds = words.RELATABLE if description.relation else words.PARTS if thing.part_color else words.KINDS
                other = replace(other, **{which: replace(thing, kind=_choice(rng, kinds))})
        distinct = other.thing.kind != description.thing.kind and (not other.other or other.other.kind != other.thing.kind)
        if distinct and meaning(other) not in seen:
            seen.add(meaning(other))
            pool.append(other)
            if len(pool) == n:
                break
    return pool


def random_pool(rng: np.random.Generator, n: int, *, held_out: bool | None = None) -> list[Description]:
    """`n` descriptions of different meaning, each saying its colours (a caption that leaves them open would fit many pictures)."""
    pool: dict[tuple, Description] = {}
    while len(pool) < n:
        description = random_description(rng, held_out=held_out)
        if description.thing.color:
            pool.setdefault(meaning(description), description)
    return list(pool.values())

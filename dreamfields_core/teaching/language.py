"""What a caption says: descriptions, the captions that tell them, and the way back."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from dreamfields_core.teaching import words


@dataclass(frozen=True)
class Thing:
    """One object. None: the caption leaves it open.

    kind: a key of `words.KINDS`.
    color: a key of `words.COLORS`.
    pattern: a key of `words.PATTERNS`.
    size: a key of `words.SIZES`.
    part_color: colour of the part that `words.PARTS` names for the kind.
    """

    kind: str
    color: str | None = None
    pattern: str | None = None
    size: str | None = None
    part_color: str | None = None


@dataclass(frozen=True)
class Description:
    """One thing, or two and how they stand: `thing` is `relation` `other`."""

    thing: Thing
    relation: str | None = None
    other: Thing | None = None


def describe(description: Description) -> str:
    """The plain caption."""
    caption = _noun_phrase(description.thing)
    if description.other is not None:
        caption = f"{caption} {description.relation} {_noun_phrase(description.other)}"
    return caption


def paraphrase(rng: np.random.Generator, description: Description) -> str:
    """One of the many captions that say the same, with synonyms, and with a prefix half the time."""
    caption = _sentence(rng, description)
    if rng.random() < 0.5:
        caption = f"{words.PREFIXES[rng.integers(len(words.PREFIXES))]} {caption}"
    return caption


def _noun_phrase(thing: Thing) -> str:
    adjectives = [word for word in (thing.size, thing.pattern, thing.color) if word]
    phrase = _article(" ".join([*adjectives, thing.kind]))
    if thing.part_color:
        part = words.PARTS[thing.kind][0]
        phrase += " with " + (_article(f"{thing.part_color} {part}") if not part.endswith("s") else f"{thing.part_color} {part}")
    return phrase


def _article(noun: str) -> str:
    return ("an " if noun[0] in "aeiou" else "a ") + noun


def _sentence(rng: np.random.Generator, description: Description) -> str:
    first = _thing(rng, description.thing)
    if description.other is None:
        return first
    second = _thing(rng, description.other)
    if description.relation == "on top of":
        form = rng.random()
        if form < 0.15:
            return f"{second} with {first} on top"
        if form < 0.3:
            return f"{second} {words.UNDER[rng.integers(len(words.UNDER))]} {first}"
    return f"{first} {_name(rng, description.relation)} {second}"


def _thing(rng: np.random.Generator, thing: Thing) -> str:
    adjectives = [_name(rng, word) for word in (thing.size, thing.pattern, thing.color) if word]
    kind = _name(rng, thing.kind)
    if rng.random() < 0.2:
        adjectives[-2:] = adjectives[-2:][::-1]
    if adjectives and rng.random() < 0.25:
        phrase = f"{_article(kind)} that is {' and '.join(adjectives)}"
    else:
        phrase = _article(" ".join([*adjectives, kind]))
    return phrase + (_part(rng, thing) if thing.part_color else "")


def _part(rng: np.random.Generator, thing: Thing) -> str:
    part, color = words.PARTS[thing.kind][0], _name(rng, thing.part_color)
    plural = part.endswith("s")
    joint = " with " if rng.random() < 0.7 else " that has "
    if rng.random() < 0.2:
        return joint + (f"{part} that are {color}" if plural else f"{_article(part)} that is {color}")
    return joint + (f"{color} {part}" if plural else _article(f"{color} {part}"))


def _name(rng: np.random.Generator, word: str | None) -> str:
    """The word itself two times in three, else one of its synonyms."""
    assert word is not None, "asked only of words that the description has"
    synonyms = [alias for alias, canonical in words.SYNONYMS.items() if canonical == word]
    return synonyms[rng.integers(len(synonyms))] if synonyms and rng.random() < 1 / 3 else word


def parse(caption: str) -> Description:
    """What a caption of the language says; the inverse of `describe` and of `paraphrase`.

    Raises:
      ValueError: the caption is outside the language; its text is one sentence.
    """
    text = _canonical(caption)
    if match := re.fullmatch(r"(.+) with (.+) on top", text):
        return Description(_parse_thing(match[2], caption), "on top of", _parse_thing(match[1], caption))
    for relation in words.RELATIONS:
        if f" {relation} " in text:
            first, second = text.split(f" {relation} ", 1)
            return Description(_parse_thing(first, caption), relation, _parse_thing(second, caption))
    if match := re.fullmatch(rf"(.+) (?:{'|'.join(words.UNDER)}) (.+)", text):
        return Description(_parse_thing(match[2], caption), "on top of", _parse_thing(match[1], caption))
    return Description(_parse_thing(text, caption))


_ALIAS = re.compile(r"\b(" + "|".join(sorted(map(re.escape, words.SYNONYMS), key=len, reverse=True)) + r")\b")
_PREFIX = re.compile(r"^(?:" + "|".join(words.PREFIXES) + r") ")
_SAYS = {word: field for field, table in (("color", words.COLORS), ("pattern", words.PATTERNS), ("size", words.SIZES)) for word in table}


def _canonical(caption: str) -> str:
    """Lower case, without prefix and punctuation, synonyms replaced, 'ice cream' held together."""
    text = _PREFIX.sub("", " ".join(words.split(caption)))
    return _ALIAS.sub(lambda match: words.SYNONYMS[match[1]], text).replace("ice cream", "ice-cream")


def _parse_thing(text: str, caption: str) -> Thing:
    body, _, part = re.sub(r"\b(that has|which has|has)\b", "with", text).partition(" with ")
    said: dict[str, str] = {}
    for word in body.split():
        name = word.replace("-", " ")
        field = _SAYS.get(name) or ("kind" if name in words.KINDS else None)
        if field is None and word in words.FUNCTION_WORDS:
            continue
        if field is None or field in said:
            raise ValueError(f"expected a caption of the small language, got {caption!r}: {word!r} does not fit; try 'a red mug'")
        said[field] = name
    if "kind" not in said:
        raise ValueError(f"expected a caption that names one of {', '.join(words.KINDS)}, got {caption!r}")
    return Thing(**said, part_color=_parse_part(said["kind"], part, caption) if part else None)


def _parse_part(kind: str, text: str, caption: str) -> str:
    colors = [word for word in text.split() if word in words.COLORS]
    part = words.PARTS.get(kind, ("",))[0]
    if len(colors) != 1 or part not in text.split():
        raise ValueError(f"expected one coloured part of a {kind} ({part or 'it has none'}), got {caption!r}")
    return colors[0]

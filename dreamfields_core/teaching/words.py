"""Every word of the small language, with its synonyms. The first name of a thing is its canonical one."""

from __future__ import annotations

import re

KINDS: dict[str, tuple[str, ...]] = {
    "sphere": ("ball",),
    "cube": ("box", "block"),
    "cylinder": (),
    "cone": (),
    "torus": ("donut", "ring"),
    "capsule": ("pill",),
    "pyramid": (),
    "star": (),
    "egg": (),
    "mug": ("cup",),
    "vase": (),
    "table": ("desk",),
    "chair": ("seat",),
    "mushroom": ("toadstool",),
    "snowman": (),
    "tree": (),
    "pine": ("pine tree", "fir tree", "fir"),
    "house": ("cottage",),
    "rocket": ("spaceship",),
    "lamp": (),
    "bottle": (),
    "hammer": ("mallet",),
    "dumbbell": ("barbell",),
    "arch": ("archway", "gate"),
    "staircase": ("stairs",),
    "cross": (),
    "car": ("automobile",),
    "lollipop": (),
    "ice cream": (),
    "flower": ("daisy",),
    "umbrella": ("parasol",),
    "boat": ("sailboat", "ship"),
    "airplane": ("plane", "aeroplane"),
    "candle": (),
    "bowl": ("dish",),
    "key": (),
}

COLORS: dict[str, tuple[float, float, float]] = {
    "red": (0.85, 0.10, 0.10),
    "orange": (0.98, 0.52, 0.06),
    "yellow": (0.98, 0.87, 0.12),
    "green": (0.13, 0.65, 0.18),
    "cyan": (0.15, 0.83, 0.87),
    "blue": (0.12, 0.23, 0.88),
    "purple": (0.50, 0.14, 0.72),
    "pink": (0.98, 0.52, 0.74),
    "brown": (0.44, 0.25, 0.11),
    "white": (0.95, 0.95, 0.95),
    "gray": (0.52, 0.52, 0.52),
    "black": (0.07, 0.07, 0.08),
}
COLOR_SYNONYMS = {"violet": "purple", "grey": "gray", "turquoise": "cyan"}

PATTERNS: dict[str, tuple[str, ...]] = {
    "striped": ("stripy",),
    "checkered": ("checked",),
    "dotted": ("spotted", "polka dot"),
}
SIZES: dict[str, tuple[str, ...]] = {"small": ("little", "tiny"), "large": ("big", "huge")}

RELATIONS: dict[str, tuple[str, ...]] = {
    "on top of": ("sitting on", "standing on", "resting on"),
    "next to": ("beside", "near"),
}
UNDER = ("under", "below", "underneath")
"""The relation 'on top of' with its two things named the other way round."""

PARTS: dict[str, tuple[str, str | None]] = {
    "house": ("roof", None),
    "mushroom": ("stem", "white"),
    "tree": ("trunk", "brown"),
    "pine": ("trunk", "brown"),
    "lamp": ("stand", None),
    "rocket": ("fins", None),
    "table": ("legs", None),
    "chair": ("legs", None),
    "mug": ("handle", None),
    "hammer": ("handle", "brown"),
    "dumbbell": ("handle", None),
    "car": ("wheels", "black"),
    "lollipop": ("stick", "white"),
    "ice cream": ("cone", "brown"),
    "flower": ("stem", "green"),
    "umbrella": ("handle", "brown"),
    "boat": ("sail", "white"),
    "airplane": ("wings", None),
    "candle": ("flame", "orange"),
    "bottle": ("cap", None),
    "snowman": ("hat", "black"),
}
"""Kind -> the part whose colour a caption may name, and that part's colour where it is not named (None: the body's, darker)."""

RELATABLE = (
    "sphere cube cylinder cone torus capsule pyramid star egg mug vase mushroom snowman tree pine house bottle car bowl candle lamp table"
).split()
"""Kinds that a relation may join: those that stay recognisable at half their size."""

PREFIXES = (
    "a picture of",
    "a photo of",
    "a render of",
    "an image of",
    "a drawing of",
    "a 3d model of",
    "a close up of",
)

SYNONYMS: dict[str, str] = {
    **{alias: kind for kind, aliases in KINDS.items() for alias in aliases},
    **COLOR_SYNONYMS,
    **{alias: name for table in (PATTERNS, SIZES, RELATIONS) for name, aliases in table.items() for alias in aliases},
}

FUNCTION_WORDS = "a an the that is are and with has which of on top".split()


def split(caption: str) -> list[str]:
    """The words of a caption, lower case, punctuation dropped."""
    return re.findall(r"[a-z0-9]+", caption.lower())


def vocabulary() -> tuple[str, ...]:
    """Every single word that a caption of the language may hold, in a fixed order."""
    phrases = [*PREFIXES, *KINDS, *COLORS, *PATTERNS, *SIZES, *RELATIONS, *UNDER, *SYNONYMS, *(part for part, _ in PARTS.values())]
    words = [word for phrase in [*FUNCTION_WORDS, *phrases] for word in split(phrase)]
    return tuple(dict.fromkeys(words))

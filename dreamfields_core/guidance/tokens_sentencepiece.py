"""Tokenizers of SigLIP, SigLIP 2 and the smaller LiT, all of them SentencePiece's (Kudo 2018), run by the `tokenizers` library."""

from __future__ import annotations

import re
import string
import struct
from collections.abc import Callable, Iterator

from tokenizers import Regex, Tokenizer, decoders, models, normalizers, pre_tokenizers

from dreamfields_core.guidance.architecture import UnfitModel
from dreamfields_core.guidance.tokens import Pieces, Tokenize, padded

UNKNOWN, CONTROL, BYTE = 2, 3, 6
"""Types of a piece in SentencePiece's model file; 1 is a normal one."""


def canonical(caption: str) -> str:
    """SigLIP: lower case, without ASCII punctuation, white space collapsed."""
    bare = caption.lower().translate(str.maketrans("", "", string.punctuation))
    return re.sub(r"\s+", " ", bare).strip()


def siglip_tokens(tokenizer: Tokenizer, *, name: str, length: int, second: bool) -> Tokenize:
    """Canonical text, </s> at the end and as padding (SigLIP); or only lower case, <eos>, <pad> (SigLIP 2)."""
    end = _id(tokenizer, "<eos>" if second else "</s>")
    padding = _id(tokenizer, "<pad>") if second else end
    return padded(_splitter(tokenizer, str.lower if second else canonical), name=name, length=length, after=(end,), padding=padding)


def lit_tokens(tokenizer: Tokenizer, *, name: str, length: int) -> Tokenize:
    """The smaller LiT: the caption as it is, </s> at the end and as padding, since the last token stands for the caption."""
    end = _id(tokenizer, "</s>")
    return padded(_splitter(tokenizer, lambda caption: caption), name=name, length=length, after=(end,), padding=end)


def from_tokenizer_json(text: str) -> Tokenizer:
    """A tokenizer from the text of a `tokenizer.json`. Raises: UnfitModel."""
    try:
        return Tokenizer.from_str(text)
    except Exception as problem:  # the library raises bare Exceptions
        raise UnfitModel(f"expected a tokenizer.json, got text that is none ({str(problem)[:80]}): fetch it again") from None


def from_model_file(data: bytes) -> Tokenizer:
    """A unigram tokenizer from the bytes of SentencePiece's own model file (`spiece.model`).

    The file is a protocol buffer of which four things matter: the pieces with their scores and types, and from the normaliser its
    table of characters and whether a space is put in front and spaces are collapsed.

    Raises:
      UnfitModel: no such file, or not a unigram one.
    """
    try:
        fields = list(_fields(data))
        pieces = [_piece(body) for number, body in fields if number == 1 and isinstance(body, bytes)]
        trainer = dict(_fields(next(body for number, body in fields if number == 2 and isinstance(body, bytes))))
        rules = dict(_fields(next(body for number, body in fields if number == 3 and isinstance(body, bytes))))
    except (StopIteration, IndexError, ValueError, struct.error):
        raise UnfitModel(f"expected SentencePiece's model file, got {len(data)} bytes that are none: fetch spiece.model again") from None
    if trainer.get(3, 1) != 1:
        raise UnfitModel("expected a unigram model in SentencePiece's file, got another kind: use the model's tokenizer.json")
    unknown = next(place for place, (_, _, kind) in enumerate(pieces) if kind == UNKNOWN)
    scores = [(piece, score) for piece, score, _ in pieces]
    tokenizer = Tokenizer(models.Unigram(scores, unknown, any(kind == BYTE for _, _, kind in pieces)))
    table = rules.get(2, b"")
    steps: list[normalizers.Normalizer] = [normalizers.Precompiled(table)] if isinstance(table, bytes) and table else []
    if rules.get(4, 1):
        steps += [normalizers.Replace(Regex("^ +| +$"), ""), normalizers.Replace(Regex(" {2,}"), " ")]
    tokenizer.normalizer = normalizers.Sequence(steps)
    tokenizer.pre_tokenizer = pre_tokenizers.Metaspace(prepend_scheme="always" if rules.get(3, 1) else "never", split=False)
    tokenizer.decoder = decoders.Metaspace()
    return tokenizer


def _splitter(tokenizer: Tokenizer, prepare: Callable[[str], str]) -> Callable[[str], Pieces]:
    tokenizer.no_padding()
    tokenizer.no_truncation()

    def split(caption: str) -> Pieces:
        found = tokenizer.encode(prepare(caption), add_special_tokens=False)
        return found.ids, [token.replace("▁", " ") for token in found.tokens]

    return split


def _id(tokenizer: Tokenizer, token: str) -> int:
    found = tokenizer.token_to_id(token)
    if found is None:
        raise UnfitModel(f"expected a tokenizer that knows {token}, got one without: it belongs to another model")
    return int(found)


def _piece(body: bytes) -> tuple[str, float, int]:
    found = dict(_fields(body))
    text, score = found[1], found.get(2, b"\0\0\0\0")
    assert isinstance(text, bytes) and isinstance(score, bytes)
    return text.decode("utf-8"), struct.unpack("<f", score)[0], int(found.get(3, 1))  # type: ignore[arg-type]


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Fields of a protocol buffer: (number, integer) or (number, bytes); 4-byte values stay bytes."""
    place = 0
    while place < len(data):
        tag, place = _varint(data, place)
        number, wire = tag >> 3, tag & 7
        if wire == 0:
            value, place = _varint(data, place)
            yield number, value
            continue
        if wire not in (1, 2, 5):
            raise ValueError(f"wire type {wire}")
        size, place = _varint(data, place) if wire == 2 else (8 if wire == 1 else 4, place)
        if place + size > len(data):
            raise ValueError("cut short")
        yield number, data[place : place + size]
        place += size


def _varint(data: bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[place]
        value |= (byte & 127) << shift
        place, shift = place + 1, shift + 7
        if byte < 128:
            return value, place

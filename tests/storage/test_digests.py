"""Digests that depend on values alone, and records that notice a changed byte."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.digests import canonical_json, json_digest, sha256_bytes, sha256_file
from storage.errors import DamagedRecord, NotJson
from storage.sealed import seal, unseal

numbers = st.integers(-(2**70), 2**70) | st.floats(allow_nan=False, allow_infinity=False)
values = st.recursive(st.none() | st.booleans() | numbers | st.text(), lambda v: st.lists(v) | st.dictionaries(st.text(), v), max_leaves=12)


def test_sha256(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc" * 100_000)
    assert sha256_file(tmp_path / "a") == sha256_bytes(b"abc" * 100_000) == hashlib.sha256(b"abc" * 100_000).hexdigest()


@given(values)
def test_canonical_json_round_trip(value: object) -> None:
    text = canonical_json(value)
    assert json.loads(text) == value
    assert canonical_json(json.loads(text)) == text


@given(st.dictionaries(st.text(), values))
def test_order_does_not_matter(value: dict[str, object]) -> None:
    assert json_digest(value) == json_digest(dict(reversed(value.items())))


def test_the_digest_of_a_value_stays_what_it_was() -> None:
    assert canonical_json({"b": [1, 1.0, None], "a": "ä"}) == b'{"a":"\\u00e4","b":[1,1.0,null]}'
    assert json_digest({"b": 1, "a": 2}) == hashlib.sha256(b'{"a":2,"b":1}').hexdigest()


@pytest.mark.parametrize("value", [float("nan"), [float("inf")], {1: 2}, {"a": [{None: 1}]}, {"a": b"bytes"}, {"a": {1, 2}}, object()])
def test_what_json_has_no_word_for(value: object) -> None:
    with pytest.raises(NotJson, match="Expected"):
        canonical_json(value)


@given(st.dictionaries(st.text().filter(lambda k: k != "checksum"), values))
def test_seal_round_trip(value: dict[str, object]) -> None:
    assert unseal(seal(value)) == value
    assert seal(unseal(seal(value))) == seal(value)


def test_every_flipped_bit_of_a_record_is_noticed() -> None:
    data = seal({"step": "mesh", "seconds": 1.5e-7, "outputs": [{"a": 10, "b": None}], "text": "ä"})
    for position in range(len(data)):
        for bit in range(8):
            damaged = bytearray(data)
            damaged[position] ^= 1 << bit
            with pytest.raises(DamagedRecord):
                unseal(bytes(damaged))


@pytest.mark.parametrize("data", [b"", b"{}", b"[]", b"null", b"\xff", b'{"checksum": 1}', b"[" * 5000])
def test_what_is_no_record(data: bytes) -> None:
    with pytest.raises(DamagedRecord, match="make it again"):
        unseal(data)


def test_truncated_records_are_noticed() -> None:
    data = seal({"a": 1})
    for length in range(len(data)):
        with pytest.raises(DamagedRecord):
            unseal(data[:length])

"""Tokens against the trusted tokenizers, over vocabularies made here, on thousands of strings."""

from __future__ import annotations

import html
import itertools
import json
import random
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import published_models as made
import pytest

from dreamfields_core.guidance.architecture import UnfitModel
from dreamfields_core.guidance.tokens import CaptionCut, cuts_told
from dreamfields_core.guidance.tokens_bert import lit_bert_tokens
from dreamfields_core.guidance.tokens_clip import clean, clip_tokens, from_tokenizer_json, from_vocab_and_merges
from dreamfields_core.guidance.tokens_sentencepiece import from_model_file, lit_tokens, siglip_tokens
from dreamfields_core.guidance.tokens_sentencepiece import from_tokenizer_json as read_tokenizer_json

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"

FRAGMENTS = [
    *made.SENTENCES[:6],
    *"A red CUBE 12 3.14 it's we'll I'd THEY'RE don't o'clock 's ' '' — – … ! ?! ... ,,, ;:() [x] {y} a_b c-d e/f".split(),
    *"#tag @me 50% $5 €9 ½ ² ⅷ".split(),
    *"é É ñ Ñ ü ß ẞ İ ı ſ Å ﬁ ﬃ ｆｕｌｌ Ωmega привет ПРИВЕТ こんにちは カタカナ 漢字 한국어 مرحبا עברית ไทย हिन्दी".split(),
    *"😀 👍🏽 👨‍👩‍👧 🇩🇪 ❤️ ☃ ♞ ∑ √ ≠".split(),
    "e\u0301", "A\u030a", "\u200b", "\u00a0", "\u3000", "\ufeff", "\u00ad", "\u202e",
    *["\t", "\n", "\r\n", "\x0b", "  ", " " * 5],
    "\x00", "\x01", "\x1c", "\x1f", "\x7f", "\x85",
    *"&amp; &lt;b&gt; &amp;lt; &eacute; &#39; &#x1F600; &nbsp; &unknown; &copy".split(),
    *"schÃ¶n â€œquotedâ€\x9d donâ€™t “smart” ‘quotes’ ""‹›".split(),
    "<|startoftext|>", "<|endoftext|>", "<|ENDOFTEXT|>", "!<|endoftext|>", "</w>", "▁", "<unk>",
]  # fmt: skip


def strings(count: int = 3000, *, without: tuple[str, ...] = ()) -> list[str]:
    """The fragments alone, then joined at random, with and without spaces; the empty text too."""
    rng = random.Random(0)
    parts = [part for part in FRAGMENTS if not any(bad in part.lower() for bad in without)]
    joined = [rng.choice(["", " "]).join(rng.choices(parts, k=rng.randint(1, 9))) for _ in range(count - len(parts) - 2)]
    return ["", " ", *parts, *joined]


def rows(tokenize: Callable[[list[str]], np.ndarray], texts: list[str]) -> list[list[int]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaptionCut)
        return tokenize(texts).tolist()


def clip_twin(vocabulary: dict[str, int], merges: list[tuple[str, str]]) -> Callable[[str], list[int]]:
    """CLIP's tokenizer, slow and obvious: merge the best pair until none is left."""
    regex, ftfy = pytest.importorskip("regex"), pytest.importorskip("ftfy")
    printable = [*range(33, 127), *range(161, 173), *range(174, 256)]
    others = [byte for byte in range(256) if byte not in printable]
    letters = {byte: chr(byte) for byte in printable} | {byte: chr(256 + place) for place, byte in enumerate(others)}
    ranks = {pair: rank for rank, pair in enumerate(merges)}
    words = regex.compile(r"<\|startoftext\|>|<\|endoftext\|>|'s|'t|'re|'ve|'m|'ll|'d|[\p{L}]+|[\p{N}]|[^\s\p{L}\p{N}]+", regex.IGNORECASE)

    def pairs(word: str) -> list[str]:
        parts = [letters[byte] for byte in word.encode("utf-8")]
        parts[-1] += "</w>"
        while len(parts) > 1:
            best = min(itertools.pairwise(parts), key=lambda pair: ranks.get(pair, len(ranks)))
            if best not in ranks:
                break
            merged, place = [], 0
            while place < len(parts):
                hit = tuple(parts[place : place + 2]) == best
                merged.append("".join(best) if hit else parts[place])
                place += 2 if hit else 1
            parts = merged
        return parts

    def ids(text: str) -> list[int]:
        text = html.unescape(html.unescape(ftfy.fix_text(text))).strip()
        text = regex.sub(r"\s+", " ", text).strip().lower()
        found = [[word] if word.startswith("<|") and word in vocabulary else pairs(word) for word in words.findall(text)]
        return [vocabulary["<|startoftext|>"], *(vocabulary[part] for word in found for part in word), vocabulary["<|endoftext|>"]]

    return ids


def test_clip_agrees_with_a_slow_twin() -> None:
    vocabulary, merges = made.clip_vocabulary()
    twin = clip_twin(vocabulary, merges)
    texts = strings()
    for text, row in zip(texts, rows(clip_tokens(vocabulary, merges, name="clip"), texts)):
        expected = twin(text)
        cut = expected if len(expected) <= 77 else [*expected[:76], expected[-1]]
        assert row == cut + [0] * (77 - len(cut)), repr(text)


def test_clip_agrees_with_the_hub_where_that_agrees_with_clip() -> None:
    """The hub's tokenizer does not unescape or mend, so it is asked about text that is clean already and has no special tokens."""
    transformers = pytest.importorskip("transformers")
    vocabulary, merges = made.clip_vocabulary()
    theirs = transformers.CLIPTokenizer(vocabulary, merges)
    texts = [text for raw in strings(2500) if clean(text := clean(raw)) == text and "<|" not in text and "ſ" not in text]
    assert len(texts) > 2000
    ours = rows(clip_tokens(vocabulary, merges, name="clip"), texts)
    for text, row, ids in zip(texts, ours, theirs(texts, truncation=True, max_length=77)["input_ids"]):
        assert row == ids + [0] * (77 - len(ids)), repr(text)


def test_clip_files_of_both_forms_agree() -> None:
    transformers = pytest.importorskip("transformers")
    vocabulary, merges = made.clip_vocabulary()
    texts = strings(200)
    plain = rows(clip_tokens(vocabulary, merges, name="clip"), texts)
    text = transformers.CLIPTokenizer(vocabulary, merges).backend_tokenizer.to_str()
    assert rows(from_tokenizer_json(text, name="clip"), texts) == plain
    lines = "#version: 0.2\n" + "\n".join(" ".join(merge) for merge in merges)
    assert rows(from_vocab_and_merges(json.dumps(vocabulary), lines, name="clip"), texts) == plain


@pytest.mark.skipif(not SHARED.is_dir(), reason="CLIP's published vocabulary is not at hand")
def test_clip_gives_its_own_ids_on_the_published_vocabulary() -> None:
    import gzip

    lines = gzip.decompress((SHARED / "bpe_simple_vocab_16e6.txt.gz").read_bytes()).decode("utf-8").split("\n")[1 : 49152 - 256 - 2 + 1]
    merges = [(left, right) for left, right in (line.split() for line in lines)]
    letters = [chr(code) for code in [*range(33, 127), *range(161, 173), *range(174, 256), *range(256, 256 + 68)]]
    words = [*letters, *(f"{letter}</w>" for letter in letters), *("".join(merge) for merge in merges), "<|startoftext|>", "<|endoftext|>"]
    tokenize = clip_tokens({word: place for place, word in enumerate(words)}, merges, name="clip", length=2000)
    cases = json.loads((SHARED / "clip_tokens.json").read_text(encoding="utf-8"))["cases"]
    wrong = [
        case["text"] for case, row in zip(cases, rows(tokenize, [case["text"] for case in cases])) if row[: len(case["ids"])] != case["ids"]
    ]
    assert len(cases) > 300 and wrong == []


@pytest.fixture(scope="module")
def sentencepiece_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """SentencePiece's own trainer writes the file: a unigram model with SigLIP's special pieces."""
    spm = pytest.importorskip("sentencepiece")
    folder = tmp_path_factory.mktemp("pieces")
    lines = [line for text in [*made.SENTENCES, *strings(400, without=("\x00",))] for line in text.splitlines()]
    (folder / "text.txt").write_text("\n".join(lines), encoding="utf-8")
    spm.SentencePieceTrainer.train(
        input=str(folder / "text.txt"), model_prefix=str(folder / "spiece"), vocab_size=400, hard_vocab_limit=False, model_type="unigram",
        character_coverage=0.995,
        pad_id=0, eos_id=1, unk_id=2, bos_id=-1, pad_piece="<pad>", eos_piece="</s>", unk_piece="<unk>", minloglevel=2,
    )  # fmt: skip
    return folder / "spiece.model"


def test_siglip_agrees_with_the_hub(sentencepiece_model: Path) -> None:
    transformers = pytest.importorskip("transformers")
    theirs = transformers.SiglipTokenizer(str(sentencepiece_model))
    texts = strings(without=("<", "&lt", "\x00", "▁"))
    ours = rows(siglip_tokens(from_model_file(sentencepiece_model.read_bytes()), name="siglip", length=64, second=False), texts)
    expected = theirs(texts, padding="max_length", truncation=True, max_length=64)["input_ids"]
    wrong = [(text, row, ids) for text, row, ids in zip(texts, ours, expected) if row != ids]
    assert not wrong, (len(wrong), wrong[:3])


def test_small_lit_agrees_with_sentencepiece(sentencepiece_model: Path) -> None:
    spm = pytest.importorskip("sentencepiece")
    theirs = spm.SentencePieceProcessor(model_file=str(sentencepiece_model))
    texts = strings(without=("<", "&lt", "\x00"))
    ours = rows(lit_tokens(from_model_file(sentencepiece_model.read_bytes()), name="lit", length=16), texts)
    for text, row in zip(texts, ours):
        ids = theirs.encode(text)[:15]
        assert row == ids + [1] * (16 - len(ids)), repr(text)


def test_siglip_2_agrees_with_the_hub() -> None:
    transformers = pytest.importorskip("transformers")
    vocabulary, merges = made.gemma_vocabulary()
    theirs = transformers.Siglip2Tokenizer(vocabulary, merges, padding_side="right", add_eos_token=True)
    texts = strings(without=("<",))
    tokenizer = read_tokenizer_json(theirs.backend_tokenizer.to_str())
    ours = rows(siglip_tokens(tokenizer, name="siglip2", length=64, second=True), texts)
    for text, row in zip(texts, ours):
        ids = theirs(text, add_special_tokens=False)["input_ids"][:63]
        assert row == [*ids, 1, *[0] * (63 - len(ids))], repr(text)


def test_lit_bert_agrees_with_the_hub(tmp_path: Path) -> None:
    transformers = pytest.importorskip("transformers")
    words = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", *dict.fromkeys("".join(strings(300)).lower().replace("\n", ""))]
    words += ["##" + letter for letter in "abcdefghijklmnopqrstuvwxyz"] + ["red", "cube", "##ing", "snow", "don", "photo"]
    vocabulary = {word: place for place, word in enumerate(dict.fromkeys(word for word in words if word.strip()))}
    theirs = transformers.BertTokenizer(vocabulary, do_lower_case=True)
    texts = strings(without=("[",))
    ours = rows(lit_bert_tokens("\n".join(vocabulary), name="lit", length=16), texts)
    for text, row in zip(texts, ours):
        ids = [vocabulary["[CLS]"], *theirs(text, add_special_tokens=False)["input_ids"]][:16]
        assert row == ids + [0] * (16 - len(ids)), repr(text)


def test_a_long_caption_is_cut_and_the_warning_says_where() -> None:
    vocabulary, merges = made.clip_vocabulary()
    tokenize = clip_tokens(vocabulary, merges, name="clip-vit-b32")
    words = " ".join(f"cube {number}" for number in range(60))
    with pytest.warns(CaptionCut, match=r'clip-vit-b32 reads 75 tokens and this caption has \d+: it is cut after "\.\.\. .*cube \d.*"$'):
        row = tokenize([words])[0]
    assert len(row) == 77 and row[0] == vocabulary["<|startoftext|>"] and row[-1] == vocabulary["<|endoftext|>"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tokenize(["a cube"])
        told: list[str] = []
        with cuts_told(told.append):
            tokenize([words, "a cube", words])
    assert len(told) == 2 and "it is cut after" in told[0]


def test_captions_of_the_wrong_kind_and_damaged_files_are_refused() -> None:
    vocabulary, merges = made.clip_vocabulary()
    tokenize = clip_tokens(vocabulary, merges, name="clip")
    assert tokenize([]).shape == (0, 77)
    with pytest.raises(TypeError, match="put it in brackets"):
        tokenize("a cube")
    with pytest.raises(TypeError, match="expected captions as text, got int"):
        tokenize([3])  # type: ignore[list-item]
    for broken in ("", "{", "[]", '{"model": {}}'):
        with pytest.raises(UnfitModel, match="fetch it again"):
            from_tokenizer_json(broken, name="clip")
    for data in (b"", b"\x00\x01", b"PK\x03\x04 not a model", b"\x0a\xff\xff\xff\xff"):
        with pytest.raises(UnfitModel, match="SentencePiece"):
            from_model_file(data)
    with pytest.raises(UnfitModel, match=r"\[CLS\]"):
        lit_bert_tokens("a\nb", name="lit", length=16)
    with pytest.raises(UnfitModel, match="startoftext"):
        clip_tokens({"a": 0}, [], name="clip")

"""CLIP's tokenizer, step by step as its own does it: mend, unescape, collapse, lower, split, byte pairs.

The vocabulary comes with the weights, in the `tokenizers` library's form; of the file only the vocabulary and merges are used, since
the fast tokenizers' own cleaning differs from CLIP's on HTML entities, mended text and special tokens inside a caption.
"""

from __future__ import annotations

import html
import json
import re

import ftfy
from tokenizers import Regex, Tokenizer, models, pre_tokenizers

from dreamfields_core.guidance.architecture import UnfitModel
from dreamfields_core.guidance.tokens import Pieces, Tokenize, padded

START, END = "<|startoftext|>", "<|endoftext|>"
# The long s is the one letter that ignoring case adds to the contractions of text in lower case.
WORDS = r"<\|startoftext\|>|<\|endoftext\|>|'[sſ]|'t|'re|'ve|'m|'ll|'d|[\p{L}]+|[\p{N}]|[^\s\p{L}\p{N}]+"


def clean(caption: str) -> str:
    """Mended (ftfy), HTML entities twice unescaped, white space collapsed, lower case: in CLIP's own order."""
    mended = html.unescape(html.unescape(ftfy.fix_text(caption))).strip()
    return re.sub(r"\s+", " ", mended).strip().lower()


def clip_tokens(vocabulary: dict[str, int], merges: list[tuple[str, str]], *, name: str, length: int = 77) -> Tokenize:
    """CLIP's tokenizer over a vocabulary and its merges, padded with zeros as CLIP's own pads.

    Raises:
      UnfitModel: the vocabulary has no start or end of text.
    """
    if not {START, END} <= vocabulary.keys():
        raise UnfitModel(
            f"expected CLIP's vocabulary with {START} and {END}, got {len(vocabulary)} tokens without: fetch tokenizer.json again"
        )
    try:
        model = models.BPE(vocab=vocabulary, merges=merges, end_of_word_suffix="</w>")
    except Exception as problem:  # the library raises bare Exceptions
        raise UnfitModel(f"expected merges that fit CLIP's vocabulary, got '{problem}': fetch the tokenizer's files again") from None
    words = pre_tokenizers.Split(Regex(WORDS), behavior="removed", invert=True)
    as_bytes = pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False)
    special = {text: vocabulary[text] for text in (START, END)}

    def split(caption: str) -> Pieces:
        ids: list[int] = []
        texts: list[str] = []
        for word, _ in words.pre_tokenize_str(clean(caption)):
            found = [special[word]] if word in special else [token.id for token in model.tokenize(as_bytes.pre_tokenize_str(word)[0][0])]
            ids += found
            texts += ["", *[""] * (len(found) - 2), f"{word} "] if len(found) > 1 else [f"{word} "]
        return ids, texts

    return padded(split, name=name, length=length, before=(special[START],), after=(special[END],))


def from_tokenizer_json(text: str, *, name: str, length: int = 77) -> Tokenize:
    """CLIP's tokenizer from the text of a `tokenizer.json`. Raises: UnfitModel."""
    try:
        Tokenizer.from_str(text)
        model = json.loads(text)["model"]
        merges = [(left, right) for left, right in (merge.split(" ") if isinstance(merge, str) else merge for merge in model["merges"])]
        return clip_tokens(model["vocab"], merges, name=name, length=length)
    except UnfitModel:
        raise
    except Exception as problem:
        raise UnfitModel(
            f"expected a byte-pair tokenizer.json, got one that cannot be read ({str(problem)[:80]}): fetch it again"
        ) from None


def from_vocab_and_merges(vocab_json: str, merges_txt: str, *, name: str, length: int = 77) -> Tokenize:
    """CLIP's tokenizer from the texts of a `vocab.json` and a `merges.txt`. Raises: UnfitModel."""
    try:
        vocabulary = {str(token): int(place) for token, place in json.loads(vocab_json).items()}
        lines = [line for line in merges_txt.split("\n") if line and not line.startswith("#version")]
        merges = [(left, right) for left, right in (line.split(" ") for line in lines)]
    except (ValueError, AttributeError) as problem:
        raise UnfitModel(f"expected vocab.json and merges.txt, got text that is neither ({problem}): fetch them again") from None
    return clip_tokens(vocabulary, merges, name=name, length=length)

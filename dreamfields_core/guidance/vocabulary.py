"""Which tokenizer a model's own files make."""

from __future__ import annotations

from collections.abc import Mapping

from dreamfields_core.guidance import tokens_sentencepiece as pieces
from dreamfields_core.guidance.architecture import Architecture, UnfitModel
from dreamfields_core.guidance.tokens import Tokenize
from dreamfields_core.guidance.tokens_bert import lit_bert_tokens
from dreamfields_core.guidance.tokens_clip import from_tokenizer_json, from_vocab_and_merges


def is_second(files: Mapping[str, bytes]) -> bool:
    """Whether a SigLIP's tokenizer is that of SigLIP 2: its captions end in <eos>, where SigLIP's end in </s>."""
    return b'"<eos>"' in files.get("tokenizer.json", b"")


def read_tokenizer(files: Mapping[str, bytes], arch: Architecture, *, name: str) -> Tokenize:
    """The tokenizer of a model from the bytes of its vocabulary's files, by name.

    Args:
      files: tokenizer.json, or vocab.json and merges.txt, or *.model (SentencePiece's), or *.txt (word pieces).
      name: of the model, for warnings and errors.

    Raises:
      UnfitModel: files of another family, damaged, or with more tokens than the text tower has.
    """
    tokenize = _read(files, arch, name)
    highest = int(tokenize(["a"]).max())
    if highest >= arch.text.vocabulary:
        raise UnfitModel(
            f"expected tokens below {arch.text.vocabulary} for {name}, got {highest}: the tokenizer's files belong to another model"
        )
    return tokenize


def _read(files: Mapping[str, bytes], arch: Architecture, name: str) -> Tokenize:
    length, kind = arch.text.length, arch.family
    model = next((data for file, data in files.items() if file.endswith(".model")), None)
    if kind == "clip" and "tokenizer.json" in files:
        return from_tokenizer_json(_text(files, "tokenizer.json"), name=name, length=length)
    if kind == "clip" and {"vocab.json", "merges.txt"} <= files.keys():
        return from_vocab_and_merges(_text(files, "vocab.json"), _text(files, "merges.txt"), name=name, length=length)
    if kind == "siglip" and "tokenizer.json" in files:
        tokenizer = pieces.from_tokenizer_json(_text(files, "tokenizer.json"))
        return pieces.siglip_tokens(tokenizer, name=name, length=length, second=is_second(files))
    if kind == "siglip" and model is not None:
        return pieces.siglip_tokens(pieces.from_model_file(model), name=name, length=length, second=False)
    if kind == "lit" and not arch.text.skip_padding and model is not None:
        return pieces.lit_tokens(pieces.from_model_file(model), name=name, length=length)
    words = next((file for file in files if file.endswith(".txt") and file != "merges.txt"), None)
    if kind == "lit" and arch.text.skip_padding and words is not None:
        return lit_bert_tokens(_text(files, words), name=name, length=length)
    raise UnfitModel(f"expected the vocabulary of a {kind} model for {name}, got {', '.join(files) or 'none'}: add the model's own files")


def _text(files: Mapping[str, bytes], name: str) -> str:
    try:
        return files[name].decode("utf-8")
    except UnicodeDecodeError as problem:
        raise UnfitModel(f"expected text in {name}, got bytes that are none ({problem.reason}): fetch it again") from None

"""BERT's tokenizer (Devlin 2018) as LiT uses it: [CLS] in front, nothing at the end, zeros as padding."""

from __future__ import annotations

from tokenizers import Tokenizer, models, normalizers, pre_tokenizers

from dreamfields_core.guidance.architecture import UnfitModel
from dreamfields_core.guidance.tokens import Pieces, Tokenize, padded


def lit_bert_tokens(vocabulary_txt: str, *, name: str, length: int) -> Tokenize:
    """The tokenizer over the text of a `vocab.txt`, one word piece a line, lower case without accents.

    Raises:
      UnfitModel: the vocabulary has no [CLS] or [UNK].
    """
    vocabulary = {piece: place for place, piece in enumerate(vocabulary_txt.rstrip("\n").split("\n"))}
    if not {"[CLS]", "[UNK]"} <= vocabulary.keys():
        raise UnfitModel(f"expected BERT's vocabulary with [CLS] and [UNK], got {len(vocabulary)} lines without: fetch the file again")
    tokenizer = Tokenizer(models.WordPiece(vocab=vocabulary, unk_token="[UNK]", max_input_chars_per_word=100))
    tokenizer.normalizer = normalizers.BertNormalizer(lowercase=True)
    tokenizer.pre_tokenizer = pre_tokenizers.BertPreTokenizer()

    def split(caption: str) -> Pieces:
        found = tokenizer.encode(caption, add_special_tokens=False)
        return found.ids, [token[2:] if token.startswith("##") else f" {token}" for token in found.tokens]

    return padded(split, name=name, length=length, before=(vocabulary["[CLS]"],))

"""caption -> text embedding: what the field's pictures are compared with (paper section 3.2)."""

from __future__ import annotations

import io

import numpy as np

from dreamfields_core.guidance.views import caption_embedding, view_captions, view_embeddings
from dreamfields_core.types import Encoder
from tasks.encoders import load_encoder
from tasks.step import Made, Work


def encode(work: Work) -> Made:
    """The caption as a unit vector of the guidance model, [dim]; where captions depend on the view, one for each view, [4, dim]."""
    guidance, caption = work.config.guidance, work.text("caption")
    encoder = load_encoder(guidance.name, towers=("text",))
    by_view = guidance.captions == "views"
    captions = view_captions(caption) if by_view else (caption,)
    _tell_unknown(work, encoder, [template.replace("{}", said) for said in captions for template in guidance.templates])
    embedding = (view_embeddings if by_view else caption_embedding)(encoder, caption, templates=guidance.templates)
    file = io.BytesIO()
    np.save(file, np.asarray(embedding, np.float32), allow_pickle=False)
    return Made((work.keep("text_embedding.npy", file.getvalue(), "application/x-npy"),))


def _tell_unknown(work: Work, encoder: Encoder, wordings: list[str]) -> None:
    """Words that a small language lacks and that the settings added; of the caption's own the user was told before."""
    told = set(encoder.unknown_words(work.text("caption")))
    added = sorted({word for wording in wordings for word in encoder.unknown_words(wording)} - told)
    if added:
        text = f"{encoder.name} does not know {', '.join(added)}, which the settings add to the caption: published models do"
        work.place.report({"event": "note", "step_name": "encode", "text": text})

"""caption -> text embedding: what the field's pictures are compared with (paper section 3.2)."""

from __future__ import annotations

import io

import jax
import jax.numpy as jnp
import numpy as np

from tasks.encoders import load_encoder
from tasks.step import Made, Work


def encode(work: Work) -> Made:
    """The caption as a unit vector of the guidance model."""
    encoder = load_encoder(work.config.guidance.name, towers=("text",))
    embedding = jax.jit(encoder.encode_text)(encoder.params, jnp.asarray(encoder.tokenize([work.text("caption")])))[0]
    file = io.BytesIO()
    np.save(file, np.asarray(embedding, np.float32), allow_pickle=False)
    return Made((work.keep("text_embedding.npy", file.getvalue(), "application/x-npy"),))

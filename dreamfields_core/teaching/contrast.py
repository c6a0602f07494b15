"""What a lesson asks for: picture and caption agree with each other most (Radford et al. 2021), and both know the facts.

Symbols: B pictures with a right and a wrong caption each, J junk pictures, D dimensions of the shared space.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import optax
from jax.typing import ArrayLike

from dreamfields_core.guidance.blocks import init_linear, linear
from dreamfields_core.teaching.album import FACTS
from dreamfields_core.types import Array, Params

SPREAD = 8.0
"""Length that unit vectors are brought to before they are asked for facts."""


def contrast(
    images: Array, texts: Array, wrong: Array, junk: Array, meaning: ArrayLike, wrong_meaning: ArrayLike, log_scale: Array
) -> Array:
    """Symmetric InfoNCE with hard captions and junk pictures; pairs of the same meaning are no negatives.

    Args:
      images, texts, wrong: unit vectors [B, D]. junk: [J, D], negatives for captions only.
      meaning, wrong_meaning: [B] equal where captions mean the same.
      log_scale: logarithm of the inverse temperature, at most log(100).
    """
    scale = jnp.exp(jnp.minimum(log_scale, jnp.log(100.0)))
    own = jnp.eye(len(images), dtype=bool)
    meaning, wrong_meaning = jnp.asarray(meaning), jnp.asarray(wrong_meaning)
    same = (meaning[:, None] == meaning[None, :]) & ~own
    same_wrong = meaning[:, None] == wrong_meaning[None, :]
    captions = jnp.where(jnp.concatenate([same, same_wrong], 1), -1e9, scale * images @ jnp.concatenate([texts, wrong]).T)
    pictures = jnp.where(same, -1e9, scale * texts @ images.T)
    pictures = jnp.concatenate([pictures, scale * texts @ junk.T], 1)
    right = jnp.arange(len(images))
    loss = optax.softmax_cross_entropy_with_integer_labels
    return 0.5 * (loss(captions, right).mean() + loss(pictures, right).mean())


def init_questions(key: Array, dim: int) -> Params:
    """One linear layer from the shared space to the answers of all `FACTS`."""
    return init_linear(key, dim, sum(map(len, FACTS.values())), scale=0.3)


def ignorance(params: Params, embeddings: Array, facts: ArrayLike) -> Array:
    """Cross entropy of the answers, a mean over questions; facts [B, questions], -1 where there is no answer."""
    facts = jnp.asarray(facts)
    logits, start, total = linear(params, SPREAD * embeddings), 0, jnp.zeros(())
    for number, options in enumerate(FACTS.values()):
        answer = facts[:, number]
        loss = optax.softmax_cross_entropy_with_integer_labels(logits[:, start : start + len(options)], jnp.maximum(answer, 0))
        total = total + jnp.where(answer >= 0, loss, 0).mean()
        start += len(options)
    return total / len(FACTS)


def toward_ball(perturbation: Array, gradient: Array, radius: Array) -> Array:
    """One ascent step of `radius` along each picture's gradient, back into the L2 ball of that radius. [B, H, W, 3]."""
    moved = perturbation + radius * gradient * jax.lax.rsqrt((gradient**2).sum((1, 2, 3), keepdims=True) + 1e-20)
    length = jnp.sqrt((moved**2).sum((1, 2, 3), keepdims=True) + 1e-12)
    return moved * jnp.minimum(1.0, radius / length)

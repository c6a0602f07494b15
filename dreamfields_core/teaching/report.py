"""The figures of a model card: retrieval of fresh pictures from the elevations that no lesson showed."""

from __future__ import annotations

import time

import jax
import jax.numpy as jnp
import numpy as np

from dreamfields_core.teaching.album import examination
from dreamfields_core.teaching.examination import attack, embed_captions, embed_images, hard_ranks, on_white, ranks
from dreamfields_core.teaching.language import Description
from dreamfields_core.teaching.pools import random_pool
from dreamfields_core.types import Encoder

POOL = 153
"""Captions that compete, as in the paper's evaluation."""


def examine(encoder: Encoder, *, seed: int = 1000, pools: int = 4, radii: tuple[float, ...] = (0.5, 1.0, 2.0)) -> dict:
    """Shares of pictures that rank their caption first (R@1) or among five (R@5), under attack, and how long a look takes."""
    results: dict = {"model": encoder.name, "digest": encoder.digest}
    for label, held_out in (("taught combinations", False), ("held-out combinations", True)):
        rows = [_retrieve(encoder, seed + i, held_out) for i in range(pools)]
        found = np.concatenate([row[0] for row in rows])
        hard = np.concatenate([row[1] for row in rows])
        results[label] = {"pictures": len(found), "R@1": share(found < 1), "R@5": share(found < 5), "R@1 hard": share(hard < 1)}
        if not held_out:
            results["by form"] = _by_form([d for row in rows for d in row[2]], found)
    results["under attack"] = {str(radius): _attacked(encoder, seed, radius) for radius in radii}
    results["seconds"] = timings(encoder)
    return results


def share(hits: np.ndarray) -> list[float]:
    """Mean and standard error of hits."""
    return [round(float(hits.mean()), 4), round(float(hits.std() / max(len(hits) - 1, 1) ** 0.5), 4)]


def _test(seed: int, held_out: bool | None) -> tuple[list[Description], np.ndarray]:
    pool = random_pool(np.random.default_rng([seed, 3]), POOL, held_out=held_out)
    return pool, on_white(examination(pool, seed=seed))


def _retrieve(encoder: Encoder, seed: int, held_out: bool | None) -> tuple[np.ndarray, np.ndarray, list[Description]]:
    pool, images = _test(seed, held_out)
    seen = embed_images(encoder, images)
    return ranks(seen, embed_captions(encoder, pool)), hard_ranks(encoder, seen, pool), pool


def _attacked(encoder: Encoder, seed: int, radius: float) -> list[float]:
    pool, images = _test(seed, False)
    texts = jnp.asarray(embed_captions(encoder, pool))
    moved = attack(encoder, jnp.asarray(images), texts, jnp.arange(POOL), radius=radius)
    return share(ranks(embed_images(encoder, np.asarray(moved)), np.asarray(texts)) < 1)


def _by_form(pool: list[Description], found: np.ndarray) -> dict[str, list[float]]:
    forms = [form_of(description) for description in pool]
    return {form: share(found[[i for i, f in enumerate(forms) if f == form]] < 1) for form in sorted(set(forms))}


def form_of(description: Description) -> str:
    """What kind of caption it is."""
    thing = description.thing
    return description.relation or (thing.pattern and "pattern") or (thing.part_color and "part") or (thing.size and "size") or "plain"


def timings(encoder: Encoder, *, batch: int = 6, repeats: int = 10) -> dict[str, float]:
    """Seconds for a batch of pictures of the model's own size: encoding, and encoding with the gradient in the picture."""
    images = jax.random.uniform(jax.random.key(0), (batch, encoder.image_size, encoder.image_size, 3))
    encode = jax.jit(encoder.encode_image)
    slope = jax.jit(jax.grad(lambda p, x: encoder.encode_image(p, x)[:, 0].sum(), argnums=1))
    times = {}
    for name, function in (("encode", encode), ("encode and gradient", slope)):
        jax.block_until_ready(function(encoder.params, images))
        started = time.perf_counter()
        for _ in range(repeats):
            jax.block_until_ready(function(encoder.params, images))
        times[f"{name}, batch {batch}"] = round((time.perf_counter() - started) / repeats, 5)
    return times

"""Are dreams recognised? 64 captions over the whole language, one seed each, by the judge that did not guide, beside its controls.

    python -m benchmarks.recognition --out dreams/recognition        resumes; what is in its store is not dreamed again

Every caption is dreamed with the draft preset and seen from the held-out cameras. The judge retrieves the caption from that
view (R-Precision, paper section 5.1) among 153 random captions, and among as many as there are with the same colours and other
kinds. Beside it the same for true renders (oracle), for balls in the right colours (control), for pixels optimised without any
field, and for chance; and what the guide itself says of all of them, which flatters.
"""

from __future__ import annotations

import argparse
import io
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
from PIL import Image, ImageDraw, ImageFont

from dreamfields_core.config import DreamConfig
from dreamfields_core.judging.retrieval import Retrieval, mean_with_error, retrieve
from dreamfields_core.png import png
from dreamfields_core.rendering.images import on_shade
from dreamfields_core.rendering.pictures import BACKDROP, picture
from dreamfields_core.scene.cameras import poses_at
from dreamfields_core.teaching import words
from dreamfields_core.teaching.control import BLOBS
from dreamfields_core.teaching.language import Description, Thing, describe, parse
from dreamfields_core.teaching.pictures import Camera, render_description
from dreamfields_core.teaching.pools import meaning, random_description
from dreamfields_core.teaching.solids import KINDS
from dreamfields_core.teaching.staging import Shapes
from flows.order import settle
from flows.recipe import Plainly, make_object
from storage.artifacts import get_artifact
from storage.digests import json_digest
from storage.local import write_file
from storage.store import open_store
from tasks.encoders import card, load_encoder
from tasks.finished_field import unpack_field, view_by
from tasks.pools import caption_pools
from tasks.step import Place

TUNED_ON = (
    "a red mushroom, a blue house with a pink roof, a yellow chair, a pink ice cream, a green pine, a brown table, a striped purple vase, "
    "a white snowman, an orange cone, a green cone on top of a red cube"
).split(", ")
"""Captions that were looked at while the recipe was made; they are not in the table."""

THUMB = 112
"""Pixels of a picture on the contact sheet."""


def table_captions(*, seed: int = 64, extra: int = 28) -> list[str]:
    """Every kind of the language once, alone in a random colour; then `extra` captions with patterns, parts and relations."""
    rng = np.random.default_rng(seed)
    colors = list(words.COLORS)
    chosen = {meaning(parse(caption)): "" for caption in TUNED_ON}
    for kind in words.KINDS:
        while meaning(plain := Description(Thing(kind, colors[rng.integers(len(colors))]))) in chosen:
            pass
        chosen[meaning(plain)] = describe(plain)
    forms: list[Callable[[Description], object]] = [lambda d: d.thing.pattern, lambda d: d.thing.part_color, lambda d: d.relation]
    for number in range(extra):
        while True:
            drawn = random_description(rng, held_out=None)
            if forms[number % 3](drawn) and meaning(drawn) not in chosen:
                break
        chosen[meaning(drawn)] = describe(drawn)
    return [caption for caption in chosen.values() if caption]


@dataclass(frozen=True)
class Row:
    """How one way of making pictures of a caption was judged. views: [V, H, W, 3] in [0, 1]."""

    caption: str
    seconds: float
    judged: dict[str, Retrieval]
    views: np.ndarray


class Judge:
    """Judge and guide, and the captions that they choose among."""

    def __init__(self, config: DreamConfig) -> None:
        self.config, self.encoder, self.guide = config, load_encoder(config.evaluate.judge), load_encoder(config.guidance.name)

    def __call__(self, caption: str, views: np.ndarray, seconds: float, shown: np.ndarray | None = None) -> Row:
        pools = caption_pools(caption, self.config.evaluate.pool)
        judged = {name: retrieve(self.encoder, views, caption, pool) for name, pool in pools.items()}
        judged |= {f"{name}, by the guide": retrieve(self.guide, views, caption, pool) for name, pool in pools.items()}
        return Row(caption, seconds, judged, views if shown is None else shown)


def dreamed(judge: Judge, caption: str, place: Place) -> Row:
    """The caption dreamed, or found in the store; without its mesh, which nobody asks for here."""
    config, look = judge.config, judge.config.evaluate
    made = make_object(Plainly(place, config), caption, config, score_only=True)
    see = view_by(unpack_field(get_artifact(place.store, made.field.output("field.safetensors"))), samples=look.samples)
    shown = picture(on_shade(see(poses_at(look.azimuths[:2], look.elevation, radius=look.radius, focal=look.focal), THUMB), BACKDROP))
    with np.load(io.BytesIO(get_artifact(place.store, made.views.output("views.npz")))) as file:
        return judge(caption, file["views"], made.field.record.seconds, shown)


def drawn(judge: Judge, caption: str, shapes: Shapes) -> Row:
    """The caption drawn from signed distances, seen from the same cameras."""
    look = judge.config.evaluate
    cameras = [Camera(np.deg2rad(a), np.deg2rad(look.elevation), look.radius, look.focal) for a in look.azimuths]
    seed = int(json_digest(caption)[:8], 16)
    pictures = render_description(parse(caption), cameras, seed=seed, shapes=shapes).astype(np.float32) / 255
    return judge(caption, pictures[..., :3] + 1 - pictures[..., 3:], 0.0)


def pixels(judge: Judge, captions: Sequence[str], *, steps: int = 300, rate: float = 0.05) -> list[Row]:
    """Pictures that climb the guide's cosine pixel by pixel, from grey with a little noise: what a score without a field is worth."""
    guide = judge.guide
    texts = guide.encode_text(guide.params, jnp.asarray(guide.tokenize(captions)))
    logits = 0.1 * jax.random.normal(jax.random.key(judge.config.seed), (len(captions), guide.image_size, guide.image_size, 3))
    adam = optax.adam(rate)

    @jax.jit
    def climb(logits: jax.Array, state: optax.OptState) -> tuple[jax.Array, optax.OptState]:
        slope = jax.grad(lambda x: -jnp.sum(guide.encode_image(guide.params, jax.nn.sigmoid(x)) * texts))(logits)
        moved, state = adam.update(slope, state)
        return optax.apply_updates(logits, moved), state

    state = adam.init(logits)
    for _ in range(steps):
        logits, state = climb(logits, state)
    images = np.asarray(jax.nn.sigmoid(logits))
    return [judge(caption, image[None], 0.0) for caption, image in zip(captions, images, strict=True)]


def summary(rows: Sequence[Row]) -> dict[str, dict[str, object]]:
    """For each pool: share of objects ranked first from the paper's view with its standard error, the same over all views, mean rank."""
    pools: dict[str, dict[str, object]] = {}
    for pool in rows[0].judged:
        judged = [row.judged[pool] for row in rows]
        first, error = mean_with_error([float(one.correct) for one in judged])
        views, views_error = mean_with_error([float(np.mean(np.array(one.ranks) == 1)) for one in judged])
        pools[pool] = {
            "R-Precision": [round(first, 4), round(error, 4)],
            "over all views": [round(views, 4), round(views_error, 4)],
            "captions": round(float(np.mean([one.pool for one in judged])), 1),
            "median rank": float(np.median([one.rank for one in judged])),
            "cosine": round(float(np.mean([one.similarity for one in judged])), 4),
            "chance": round(float(np.mean([1 / one.pool for one in judged])), 4),
        }
    return pools


def sheet(rows: Sequence[Row], *, columns: int = 8) -> np.ndarray:
    """Two views of every object with its caption and its two ranks, uint8 [H, W, 3]."""
    font, band = ImageFont.load_default(11), 30
    cells = []
    for row in rows:
        cell = Image.new("RGB", (2 * THUMB, THUMB + band), (255, 255, 255))
        cell.paste(Image.fromarray(np.concatenate(list(row.views[:2]), axis=1)), (0, 0))
        ranks = f"{row.judged['random'].rank} of {row.judged['random'].pool}, hard {row.judged['hard'].rank} of {row.judged['hard'].pool}"
        draw = ImageDraw.Draw(cell)
        draw.text((3, THUMB + 2), row.caption[:44], fill=(20, 20, 20), font=font)
        draw.text((3, THUMB + 15), ranks, fill=(20, 110, 40) if row.judged["random"].correct else (170, 40, 30), font=font)
        cells.append(np.asarray(cell))
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % columns)
    lines = [np.concatenate(cells[start : start + columns], axis=1) for start in range(0, len(cells), columns)]
    return np.concatenate(lines, axis=0)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("dreams/recognition"), help="folder of the store, the table and the contact sheet")
    parser.add_argument("--captions", type=int, default=64, help="how many of the 64 (default: all)")
    parser.add_argument("--preset", default="draft")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="PART.KEY=VALUE")
    arguments = parser.parse_args()
    config = settle(arguments.preset, seed=arguments.seed, settings=arguments.settings)
    judge, place = Judge(config), Place(open_store(str(arguments.out / "store")))
    captions = table_captions()[: arguments.captions]
    dreams: list[Row] = []
    for caption in captions:
        began = time.monotonic()
        dreams.append(dreamed(judge, caption, place))
        ranks = {name: one.rank for name, one in dreams[-1].judged.items()}
        print(f"{len(dreams)}/{len(captions)} {caption}: ranks {ranks}, {time.monotonic() - began:.0f} s", flush=True)
    rows = {"dreams": dreams} | {name: [drawn(judge, c, s) for c in captions] for name, s in (("oracle", KINDS), ("control", BLOBS))}
    rows["pixels"] = pixels(judge, captions)
    results = {name: summary(group) for name, group in rows.items()}
    each = {row.caption: {name: [one.rank, one.pool] for name, one in row.judged.items()} for row in dreams}
    seconds = [row.seconds for row in dreams]
    facts = {
        "guide": card(config.guidance.name).digest,
        "judge": card(config.evaluate.judge).digest,
        "seconds of optimising": {"median": float(np.median(seconds)), "largest": max(seconds)},
    }
    write_file(arguments.out / "recognition.json", json.dumps({**facts, **results, "ranks": each}, indent=2).encode())
    write_file(arguments.out / "recognition.png", png(sheet(dreams)))
    print(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()

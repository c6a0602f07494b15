"""Finished meshes of real fields: are they closed, valid in every format, and do they look like their fields?

Twelve captions of the embedded models' language, none of which was looked at while the way to the mesh was made: a dream of the draft
preset each, and the paper's residual network that holds the same object and has dreamed on for some steps (`scenes.settled`; to dream it
from nothing takes hours on a processor). Fields and meshes are kept in the cache, so that the command resumes.
"""

from __future__ import annotations

import io
import math
import tempfile
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import jax
import numpy as np
from PIL import Image

from benchmarks import scenes
from benchmarks.reading import differences, gltf_findings, usd_findings
from dreamfields_core.config import DreamConfig, override
from dreamfields_core.dreaming.state import state_to_arrays
from dreamfields_core.meshing import from_glb, render_mesh
from dreamfields_core.meshing.errors import SilhouetteEmpty
from dreamfields_core.presets import preset
from dreamfields_core.rendering.images import on_shade
from dreamfields_core.rendering.pictures import BACKDROP, picture
from dreamfields_core.scene.cameras import camera_rays, poses_at
from storage.artifacts import ArtifactRef, get_artifact, put_artifact
from storage.store import open_store
from tasks.encoders import card
from tasks.finished_field import MEDIA_TYPE, FinishedField, pack_field, view_by
from tasks.step import Done, Place, perform
from tasks.steps import MESH, MESH_SCORE, SCORE, VIEWS

CAPTIONS = (
    "a green mug",
    "a yellow rocket",
    "a red lamp",
    "an orange car",
    "a blue tree",
    "a purple torus",
    "a pink capsule",
    "a striped orange bottle",
    "a white house with a red roof",
    "a yellow lollipop with a brown stick",
    "a red cone next to a blue cube",
    "a green egg on top of a purple bowl",
)
THUMB = 160
"""Pixels of a picture beside the results."""


@dataclass(frozen=True)
class Options:
    """captions: how many of the twelve. fields: draft, settled or both. fit_steps, dream_steps: of making a settled residual network.
    settings: changes to the draft preset, as `--set` takes them; half the texture's side and no film, which the network would make slow."""

    captions: int = len(CAPTIONS)
    fields: tuple[str, ...] = ("draft", "settled")
    fit_steps: int = 300
    dream_steps: int = 4
    settings: tuple[str, ...] = ("seed=0", "mesh.texture=512", "evaluate.turntable_frames=1", "evaluate.picture_size=64")


def run(options: Options) -> dict[str, Any]:
    """A row per field that shows an object; the headline is over all of them. empty: fields that are nowhere opaque, and have no mesh."""
    config = override(preset("draft"), options.settings)
    place = Place(open_store(str(scenes.folder() / "assets")))
    rows, empty = [], []
    for kind, caption in product(options.fields, CAPTIONS[: options.captions]):
        dream = scenes.dreamed(config, caption=caption)
        if kind == "settled":
            dream = scenes.settled(source=config, caption=caption, fit_steps=options.fit_steps, dream_steps=options.dream_steps)
        try:
            rows.append({"field": kind, "caption": caption, **measure(dream, caption, config, place)})
        except SilhouetteEmpty as error:
            empty.append({"field": kind, "caption": caption, "said": str(error)})
            print(f"{kind}, {caption}: {error}", flush=True)
            continue
        print(f"{len(rows)} {kind}, {caption}: silhouette {rows[-1]['silhouette']:.3f}, ranks {rows[-1]['ranks']}", flush=True)
    return {"headline": headline(rows) | {"empty": len(empty)}, "options": options.__dict__, "rows": rows, "empty": empty}


def headline(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Over fields of one kind each, and counts over all. first_*: how many times the judge ranks the caption first."""
    kinds = {row["field"] for row in rows}
    silhouettes = {kind: float(np.median([row["silhouette"] for row in rows if row["field"] == kind])) for kind in kinds}
    return {
        **{f"silhouette_{kind}": round(median, 4) for kind, median in sorted(silhouettes.items())},
        "objects": len(rows),
        "closed": sum(row["watertight"] and row["manifold"] and row["volume"] > 0 for row in rows),
        "gltf_findings": sum(row["gltf_findings"] for row in rows) if all(row["gltf_findings"] is not None for row in rows) else None,
        "usd_findings": sum(row["usd_findings"] for row in rows),
        "reload_differences": sum(row["reload_differences"] for row in rows),
        "first_field": sum(row["ranks"]["field"] == 1 for row in rows),
        "first_mesh": sum(row["ranks"]["mesh"] == 1 for row in rows),
    }


def measure(dream: FinishedField, caption: str, config: DreamConfig, place: Place) -> dict[str, Any]:
    """The steps of a dream that follow its field, and what other programs say of the files."""
    config = config.model_copy(update={"field": dream.config.field})
    field = put_artifact(place.store, "field.safetensors", packed(dream), MEDIA_TYPE)
    made = perform(MESH, place, config, {"field": field, "caption": caption, "guide": card(config.guidance.name).digest})
    glb = get_artifact(place.store, made.output("mesh.glb"))
    told = made.record.values
    with tempfile.TemporaryDirectory() as folder:
        found = {
            "gltf_findings": gltf_findings(glb, Path(folder)),
            "usd_findings": usd_findings(glb, Path(folder)),
            "reload_differences": differences(glb, Path(folder)),
        }
    return {
        "silhouette": told["fidelity"]["silhouette"],
        "image_db": told["fidelity"]["image"],
        "depth": told["fidelity"]["depth"],
        **{name: told["mesh"][name] for name in ("watertight", "manifold", "volume", "faces", "components", "crossing")},
        "pieces_extracted": told["extracted"]["components"],
        "points_asked": told["points_asked"],
        "seconds": made.record.seconds,
        "ranks": _ranks(place, config, caption, field, made),
        "pictures": _pictures(dream, glb, config, place).to_json(),
        **found,
    }


def packed(dream: FinishedField) -> bytes:
    """The field as a file, as the optimisation leaves it."""
    learned: Any = {"params": dream.params, "origin": dream.origin, "occupancy": dream.occupancy}
    return pack_field(state_to_arrays(learned), dream.config)


def _ranks(place: Place, config: DreamConfig, caption: str, field: ArtifactRef, mesh: Done) -> dict[str, int]:
    judge = card(config.evaluate.judge)
    views = perform(VIEWS, place, config, {"field": field, "size": config.evaluate.size or judge.image_size}).output("views.npz")
    said = {"views": views, "caption": caption, "judge": judge.digest}
    of_field = perform(SCORE, place, config, said).record.values["field"]
    of_mesh = perform(MESH_SCORE, place, config, {**said, "mesh": mesh.output("mesh.glb")}).record.values["mesh"]
    return {"field": of_field["random"]["rank"], "mesh": of_mesh["random"]["rank"]}


def _pictures(dream: FinishedField, glb: bytes, config: DreamConfig, place: Place) -> ArtifactRef:
    """The first held-out view and the one across it, of the field and of the mesh, uint8 [H, 4 H, 3], as a PNG in the store."""
    look = config.evaluate
    poses = poses_at(look.azimuths[::2][:2], look.elevation, radius=look.radius, focal=look.focal)
    seen = view_by(dream, samples=look.samples)(poses, THUMB)
    of_field = picture(on_shade(seen, BACKDROP))
    rays = jax.device_get(camera_rays(poses, dream.origin, size=THUMB))
    mine = render_mesh(from_glb(glb), rays.origins, rays.directions)
    of_mesh = picture(np.where(mine.hit[..., None], mine.color, BACKDROP))
    file = io.BytesIO()
    Image.fromarray(np.concatenate([*of_field, *of_mesh], axis=1)).save(file, "PNG")
    return put_artifact(place.store, "beside.png", file.getvalue(), "image/png")


def plot(result: dict[str, Any], path: Path) -> None:
    """Every field beside its mesh, two views each; the caption, the silhouettes' agreement and the two ranks below."""
    import matplotlib.pyplot as plt

    store = open_store(str(scenes.folder() / "assets"))
    rows, across = result["rows"], 3
    figure, axes = plt.subplots(math.ceil(len(rows) / across), across, figsize=(15, 1.55 * len(rows) / across), squeeze=False)
    for panel in axes.ravel():
        panel.axis("off")
    for panel, row in zip(axes.ravel(), rows, strict=False):
        panel.imshow(_pixels(get_artifact(store, ArtifactRef.from_json(row["pictures"]))))
        words = f"{row['field']}: {row['caption']}, {row['silhouette']:.3f}, ranks {row['ranks']['field']} and {row['ranks']['mesh']}"
        panel.set_title(words, fontsize=9, y=-0.2)
    figure.tight_layout()
    figure.savefig(path, dpi=90)
    plt.close(figure)


def _pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data), formats=["PNG"]))

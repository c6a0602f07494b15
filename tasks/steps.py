"""The steps of a dream: what each reads, takes and gives. Their code is loaded when one is really run, not when it is cached."""

from __future__ import annotations

from pkgutil import resolve_name

from tasks.compiled import keep_compiled
from tasks.step import Made, Step, Work


class Later:
    """A function of another module, imported at its first call: a finished step costs no start of JAX."""

    def __init__(self, place: str) -> None:
        self._place = place

    def __call__(self, work: Work) -> Made:
        keep_compiled()
        made = resolve_name(self._place)(work)
        assert isinstance(made, Made)
        return made


ENCODE = Step("encode", 1, ("guidance",), Later("tasks.encode:encode"))
"""caption, guide (digest) -> text_embedding.npy: [dim], or [4, dim] where captions depend on the view."""

OPTIMIZE = Step(
    "optimize",
    2,
    ("seed", "scene", "camera", "field", "render", "augment", "guidance", "loss", "optim"),
    Later("tasks.optimize:optimize"),
)
"""text_embedding, guide (digest) -> field.safetensors, history.npz, preview.png, glimpses.npz (a held-out view now and then on the way);
values: steps, rate_scale, last metrics."""

CAMERAS = ("evaluate.azimuths", "evaluate.elevation", "evaluate.radius", "evaluate.focal")
"""From where held-out views are taken."""

VIEWS = Step("views", 1, (*CAMERAS, "evaluate.samples"), Later("tasks.render:views"))
"""field, size (pixels that the judge sees) -> views.npz, the held-out views and the scene's origin."""

RENDER = Step(
    "render",
    4,
    (*CAMERAS, "evaluate.samples", "evaluate.picture_size", "evaluate.turntable_frames"),
    Later("tasks.render:render"),
)
"""field, caption -> contact_sheet.png; turntable, turntable_depth, turntable_transmittance, each .mp4 and .webp."""

MESH = Step(
    "mesh",
    5,
    # What decided the field decides the mesh too, and its file says so.
    (*OPTIMIZE.reads, "mesh", *RENDER.reads),
    Later("tasks.mesh:mesh"),
)
"""field, caption, guide (digest) -> mesh.glb, mesh_lod1.glb ..., mesh_turntable.mp4 and .webp; values: counts before and after
simplification, level, agreement with the silhouettes, fidelity to the field from held-out cameras."""

JUDGE = ("evaluate.judge", "evaluate.pool")

SCORE = Step("score", 2, JUDGE, Later("tasks.score:score"))
"""views, glimpses, caption, judge (digest) -> values: what the judge retrieves in each pool of captions, and its ranks on the way."""

MESH_SCORE = Step("mesh_score", 1, (*CAMERAS, *JUDGE), Later("tasks.score:score_mesh"))
"""mesh, views (for their size and origin), caption, judge (digest) -> values: the same of the mesh, seen from the same cameras."""

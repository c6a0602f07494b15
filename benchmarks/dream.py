"""Whole dreams: the residual network with skipping, the same without, and the hybrid field; seconds, and the judge's cosine.

The dense dream costs hours on a few cores. With `--dense sampled` it is not dreamt: every so often one dense step is taken from the
skipping dream's state and thrown away, and since a dense step costs the same whatever the scene, their mean times the number
of steps is what the dense dream would have taken. The difference in cosine is then not known and left empty.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import scenes
from benchmarks.courses import Dream, Sample, judge_of
from benchmarks.drawing import sheet
from dreamfields_core.config import DreamConfig, ResidualMLPConfig, SkipConfig, override
from dreamfields_core.dreaming.program import DreamProgram
from dreamfields_core.judging.retrieval import mean_with_error
from dreamfields_core.presets import preset
from storage.digests import json_digest
from tasks.encoders import load_encoder

CAPTIONS = (
    "a red mushroom",
    "a blue cup",
    "a pink ice cream",
    "a green tree",
    "a yellow house",
    "a purple sphere",
    "an orange cone",
    "a white table",
)


@dataclass(frozen=True)
class Options:
    """captions: of CAPTIONS, the first so many. steps: of the residual network. hybrid_steps: of the hybrid field, 0 for as many.
    dense: "whole" dreams without skipping too, "sampled" takes one dense step in `every`. rate: Adam's, of the residual network,
    which learns at the paper's 1e-4 in ten thousand steps. settings: of the preset `draft`, as `--set` takes them."""

    captions: int = 8
    steps: int = 1000
    hybrid_steps: int = 0
    dense: str = "whole"
    every: int = 50
    rate: float = 5e-4
    settings: tuple[str, ...] = ("seed=0",)


def run(options: Options) -> dict[str, Any]:
    """A row per caption and way. A caption's row is kept in the cache as soon as it is there: run again, the rest is made."""
    if options.dense not in ("whole", "sampled"):
        raise SystemExit(f'expected --dense whole or sampled, got "{options.dense}"')
    configs = ways(options)
    guide = load_encoder(configs["hybrid"].guidance.name)
    programs = {name: DreamProgram(config, guide) for name, config in configs.items()}
    said = [config.model_dump(mode="json") for config in configs.values()]
    rows = []
    for caption in CAPTIONS[: options.captions]:
        name = json_digest(["dream", caption, said, guide.digest, options.dense, options.every])
        rows.append(
            json.loads(scenes.kept(name, lambda caption=caption: json.dumps(compared(caption, programs, options)).encode(), ending="json"))
        )
    return {"headline": headline(rows), "clock": "processor seconds over all cores", "options": options.__dict__, "rows": rows}


def compared(caption: str, programs: dict[str, DreamProgram], options: Options) -> dict[str, Any]:
    """One caption, dreamed every way; the dreams take turns, a step each, so that what else the machine does falls on all of them."""
    text, look = scenes.text_embedding(programs["hybrid"].encoder, caption), judge_of(programs["hybrid"].config, caption)
    dreams = {name: Dream(program, text, look) for name, program in programs.items() if name != "dense" or options.dense == "whole"}
    beside = None if "dense" in dreams else Sample(programs["dense"], text, options.every)
    while under_way := [dream for dream in dreams.values() if not dream.is_over]:
        if beside and not dreams["skipping"].is_over:
            beside(dreams["skipping"].state)
        for dream in under_way:
            dream.advance()
    row: dict[str, Any] = {"caption": caption, **{name: dream.course.row() for name, dream in dreams.items()}}
    return row | ({"dense": beside.row(options.steps)} if beside else {})


def ways(options: Options) -> dict[str, DreamConfig]:
    """The draft preset's resolution for all; the residual network with and without skipping, and the preset as it is."""
    draft = override(preset("draft"), options.settings)
    hybrid = draft.model_copy(update={"optim": draft.optim.model_copy(update={"steps": options.hybrid_steps or options.steps})})
    optim = draft.optim.model_copy(update={"steps": options.steps, "rate_start": options.rate, "rate": options.rate, "rate_end": None})
    # The savings of the presets of the paper's network; when they begin and how often they look, of the draft.
    savings = preset("low").render.skip.model_dump() | draft.render.skip.model_dump(include={"warmup_steps", "refresh_every"})
    skips = {"skipping": SkipConfig.model_validate(savings), "dense": SkipConfig(enabled=False)}
    skipping, dense = (
        draft.model_copy(
            update={"field": ResidualMLPConfig(), "optim": optim, "render": draft.render.model_copy(update={"skip": skips[name]})}
        )
        for name in ("skipping", "dense")
    )
    return {"skipping": skipping, "dense": dense, "hybrid": hybrid}


def headline(rows: list[dict[str, Any]]) -> dict[str, float | None]:
    """Ratios of total processor seconds; the judge's mean difference, ours minus dense, and its standard error over the captions."""
    spent = {name: sum(row[name]["processor_s"] for row in rows) for name in ("skipping", "dense", "hybrid")}
    pairs = [row["skipping"]["cosine"] - row["dense"]["cosine"] for row in rows if "cosine" in row["dense"]]
    mean, error = mean_with_error(pairs) if pairs else (None, None)
    return {
        "speedup": round(spent["dense"] / spent["skipping"], 3),
        "speedup_hybrid": round(spent["skipping"] / spent["hybrid"], 3),
        "cosine_difference": mean,
        "cosine_standard_error": error if error is not None and np.isfinite(error) else None,
        "captions": len(rows),
    }


def plot(result: dict[str, Any], path: Path) -> None:
    """The judge's cosine against the seconds spent."""
    with sheet(path) as panels:
        for name, color in (("skipping", "tab:red"), ("dense", "tab:gray"), ("hybrid", "tab:blue")):
            courses = [row[name]["looks"] for row in result["rows"] if "looks" in row[name]]
            for number, looks in enumerate(courses):
                panels[0].plot(
                    [spent for _, spent, _ in looks],
                    [cosine for *_, cosine in looks],
                    ".-",
                    color=color,
                    alpha=0.7,
                    label=name if not number else None,
                )
        panels[0].set(xscale="log", xlabel="processor seconds", ylabel="judge's cosine with the caption", title="whole dreams")

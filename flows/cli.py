"""The command `dreamfields`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from dreamfields_core.captions import CaptionError
from dreamfields_core.config import ConfigError
from flows import asset_commands, report_command
from flows.exits import INTERRUPTED
from flows.order import OrderError, settle, take_order
from flows.tables import TableError
from storage.errors import BadAddress
from tasks.encoders import EncoderError, describe_encoders
from tasks.version import PACKAGES

app = typer.Typer(
    name="dreamfields",
    help="A caption in, a coloured mesh out (Dream Fields, Jain et al. 2022).",
    epilog='Example: dreamfields dream "a red mushroom"',
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
)

UsageError = typer.BadParameter.__mro__[1]
"""Whatever the parser refuses. Newer releases of typer bring a click of their own, so it is found by kinship."""

REFUSED = (BadAddress, CaptionError, ConfigError, EncoderError, OrderError, TableError)

Settings = Annotated[list[str] | None, typer.Option("--set", metavar="PART.KEY=VALUE", help="Change a setting; may be repeated.")]
MODEL = "a name that `dreamfields models` lists, a folder, owner/name on the hub, or several as A+B*0.5"
Preset = Annotated[str, typer.Option(help="draft, low, medium or high.")]


@app.command(epilog='Example: dreamfields dream "a red mushroom" --preset draft --set mesh.faces=5000')
def dream(
    caption: Annotated[str, typer.Argument(help='What to dream, for instance "a red mushroom".')],
    preset: Preset = "draft",
    seed: Annotated[int | None, typer.Option(help="The same seed gives the same object.")] = None,
    guidance: Annotated[str | None, typer.Option(help=f"The image-text model to optimise with: {MODEL}.")] = None,
    judge: Annotated[str | None, typer.Option(help="The image-text model that scores the result, named likewise.")] = None,
    out: Annotated[Path, typer.Option(help="Folder in which every dream gets one of its own.")] = Path("dreams"),
    store: Annotated[str | None, typer.Option(help="Folder or s3://bucket/prefix; $DREAMFIELDS_STORE, else OUT/store.")] = None,
    settings: Settings = None,
) -> None:
    """Dream one caption: optimise a field, mesh it, score it. Ctrl-C saves; the same command goes on."""
    from flows.plain import dream_plainly

    order = take_order(caption, preset=preset, seed=seed, guidance=guidance, judge=judge, settings=settings or (), store=store, out=out)
    raise typer.Exit(dream_plainly(order))


@app.command(epilog="Example: dreamfields sweep embedded:12 --table table3 --variants 'none,clipped additive T' --seeds 0,1")
def sweep(
    captions: Annotated[
        str | None,
        typer.Argument(
            metavar="[FILE|SET]", help="coco, embedded:COUNT, coco:captions_*.json, or a .txt, .csv or .json file; else the table's own."
        ),
    ] = None,
    table: Annotated[str | None, typer.Option(help="A table of the paper: its rows are the variants, its judges score.")] = None,
    variants: Annotated[str, typer.Option(help="Some of its rows, with commas between them.")] = "",
    seeds: Annotated[str, typer.Option(help="Numbers with commas between them; by default the table's own, else 0.")] = "",
    preset: Preset = "draft",
    guidance: Annotated[str | None, typer.Option(help=f"The image-text model to optimise with: {MODEL}.")] = None,
    judge: Annotated[str | None, typer.Option(help="The image-text model that scores, named likewise.")] = None,
    out: Annotated[Path, typer.Option(help="Folder of the dreams and of the report.")] = Path("dreams"),
    store: Annotated[str | None, typer.Option(help="Folder or s3://bucket/prefix; $DREAMFIELDS_STORE, else OUT/store.")] = None,
    settings: Settings = None,
    score_only: Annotated[bool, typer.Option("--score-only", help="Only fields and their scores: no pictures, no meshes.")] = False,
) -> None:
    """Dream captions x seeds x variants, one after the other, and write a report. Ctrl-C saves; the same command goes on."""
    from flows.sweep_plain import sweep_plainly
    from flows.sweep_plan import listed, plan_sweep, seeds_of

    plan = plan_sweep(
        captions,
        table=table,
        variants=listed(variants),
        seeds=seeds_of(seeds),
        preset=preset,
        guidance=guidance,
        judge=judge,
        settings=settings or (),
        store=store,
        out=out,
        score_only=score_only,
    )
    raise typer.Exit(sweep_plainly(plan))


@app.command(epilog="Example: dreamfields settings --preset high")
def settings(preset: Preset = "draft", changes: Settings = None) -> None:
    """List every setting of a preset with its value, as --set takes it."""
    from flows.listing import lines

    for line in lines(settle(preset, settings=changes or ())):
        typer.echo(line)


@app.command(epilog='Example: dreamfields models, then: dreamfields dream "a marble bust" --guidance clip-vit-b16 --judge clip-vit-b32')
def models() -> None:
    """List the image-text models for --guidance and --judge: size, input size in pixels, licence, and what is on disk already."""
    from flows.listing import models as table

    for line in table(describe_encoders()):
        typer.echo(line)


asset_commands.register(app)
report_command.register(app)


@app.command(
    epilog="Example: dreamfields bench step --poses 3, from a checkout",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def bench(
    context: typer.Context,
    name: Annotated[
        str,
        typer.Argument(
            help="step, sample, render, dream, mesh, assets, encoder, store or report; its options follow (benchmarks/NAME.py)."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder of the JSON and the plot; benchmarks/results if none.")] = None,
) -> None:
    """Measure time against error, ours against the dense path, in one run."""
    from flows.measuring import measure

    measure(name, context.args, out=out)


def main() -> None:
    """Run the command. Exit codes: 0 done, 1 failed, 2 refused before any work, 130 interrupted; a sentence on stderr says why."""
    try:
        code = app(prog_name="dreamfields", standalone_mode=False) or 0
        if code == INTERRUPTED:  # what typer makes of Ctrl-C; a dream and a sweep that were begun say themselves how to go on
            _end("interrupted: nothing is lost, the same command goes on", INTERRUPTED)
        sys.exit(code)
    except typer.Abort:
        _end("interrupted", INTERRUPTED)
    except REFUSED as error:
        _end(str(error), 2)
    except Exception as error:
        if isinstance(error, UsageError):
            _end(_refusal(error), 2)
        if type(error).__module__.split(".")[0] not in PACKAGES:
            raise  # not one of our sentences: a fault, to be seen whole
        _end(str(error), 1)


def _refusal(error: Any) -> str:
    """What the parser says, as one sentence with the way out; nothing where it has printed the help itself."""
    message = error.format_message().rstrip(".?")
    command = error.ctx.command_path if error.ctx else "dreamfields"
    return f"{message[0].lower()}{message[1:]}: see `{command} --help`" if message else ""


def _end(sentence: str, code: int) -> NoReturn:
    if sentence:
        typer.echo(f"dreamfields: {sentence}", err=True)
    sys.exit(code)


if __name__ == "__main__":
    main()

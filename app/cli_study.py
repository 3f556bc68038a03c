"""Commands that measure in pictures: perceive, annotate, evaluate, ablation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli_options import (
    ConfigOption,
    JsonOption,
    ModelOption,
    PresetOption,
    ProgressOption,
    check_masks,
    tell_asked_progress,
)
from core.errors import UserError


def perceive(
    images: Annotated[list[Path], typer.Argument(help="pictures, folders of pictures, or videos")],
    jsonl: Annotated[str, typer.Option(metavar="<path>", help="one JSON object per image; -: standard output")] = "-",
    masks: Annotated[Path | None, typer.Option(help="folder for <stem>_vessel.png and <stem>_robot.png")] = None,
    targets: Annotated[Path | None, typer.Option(help='JSON {"stem": [x, y]}: where the operator wants to go')] = None,
    overlay: Annotated[Path | None, typer.Option(help="folder for pictures with everything drawn in")] = None,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Vessel, robot, angle, distances and pose state of pictures or a video."""
    from app.perceive_command import Outputs, run_perceive

    lines = None if jsonl == "-" else Path(jsonl)  # ./- is a file
    run_perceive(images, Outputs(lines, masks, overlay), targets_path=targets, model=model, preset=preset, config_path=config)


def annotate(
    paths: Annotated[list[Path] | None, typer.Argument(help="folders, pictures, videos or sessions; default: this folder")] = None,
    store: Annotated[Path | None, typer.Option(help="annotation file; default: annotations.lumenpilot.sqlite there")] = None,
    rater: Annotated[str | None, typer.Option(help="who annotates; default: the user's name")] = None,
    study: Annotated[
        str | None,
        typer.Option(
            help='blind study of this name: begun at the first call, gone on with at later ones; --report, --export: "" outside any'
        ),
    ] = None,
    repeats: Annotated[int | None, typer.Option(min=1, max=20, help="how often a study shows each image; default: 2")] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="repeats of a study are shown mirrored")] = False,
    turn: Annotated[bool, typer.Option("--turn", help="repeats of a study are shown turned by 180 degrees")] = False,
    order: Annotated[str | None, typer.Option(help="listed, random, worst (least sure first) or even (evenly over time)")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="of the shuffled order")] = None,
    frames: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="pictures taken of each video, evenly; default: those taken before, or 48"),
    ] = None,
    report: Annotated[bool, typer.Option("--report", help="agreement within and between raters, instead of the window")] = False,
    export: Annotated[str | None, typer.Option(help="dataset (for train), csv (for evaluate) or coco, to --out")] = None,
    import_: Annotated[list[Path] | None, typer.Option("--import", help="labelme or COCO file or folder; may be repeated")] = None,
    join: Annotated[
        list[Path] | None, typer.Option("--join", help="take in the answers of another annotation file; may be repeated")
    ] = None,
    as_: Annotated[
        list[str] | None, typer.Option("--as", metavar="THERE=HERE", help="what a rater of joined files is called here")
    ] = None,
    salvage: Annotated[bool, typer.Option("--salvage", help="copy what is readable of a damaged annotation file")] = False,
    out: Annotated[Path | None, typer.Option(help="where report or export go")] = None,
    json: JsonOption = False,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """Measure angles and states by hand, draw masks; as a study with several raters, blind and repeated."""
    from app.annotate_command import run_annotate
    from app.annotate_options import AnnotateOptions, StudyOptions

    if study == "" and not report and export is None:  # who annotates into a study that has no name would not be blind
        raise UserError("--study is empty: give it a value, or leave it out (is a variable of a script not set?)")
    options = AnnotateOptions(
        paths=tuple(paths or ()),
        store=store,
        study=StudyOptions(study, rater, repeats, mirror, turn, seed, order),
        frames=frames,
        report=report,
        export=export,
        imports=tuple(import_ or ()),
        joins=tuple(join or ()),
        names=tuple(as_ or ()),
        salvage=salvage,
        out=out,
        as_json=json,
        model=model,
        config_path=config,
    )
    sys.exit(run_annotate(options))


def evaluate(
    out: Annotated[Path, typer.Option(help="folder for metrics.json, measurements.csv, figures and report.html")],
    labelled: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="labelled set as synth writes it, or images annotated by hand")
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(help="columns image, angle_1, angle_2, state, algorithm_angle, algorithm_state; blank where not measured"),
    ] = None,
    json: JsonOption = False,
    like_paper: Annotated[
        bool, typer.Option("--like-paper", help="draw a test like the paper's: 48 images, measured twice with an error")
    ] = False,
    manual_sd: Annotated[
        float | None, typer.Option(min=0, max=30, help="SD of one such manual measure, degrees; default: 1.5")
    ] = None,
    study: Annotated[
        str | None, typer.Option(help='this study of images annotated by hand, its raters and repeats too; "": outside studies')
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the drawn images, their manual errors and the bootstrap")] = 0,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    progress_json: ProgressOption = False,
) -> None:
    """The algorithm against manual measures, with the statistics of the paper beside its own figures."""
    from app.evaluate_command import LikePaper, run_evaluate

    if manual_sd is not None and not like_paper:
        raise UserError("--manual-sd is for --like-paper")
    if json and progress_json:
        raise UserError("--json and --progress-json both write to standard output: give one of them")
    tell_asked_progress(progress_json)
    run_evaluate(
        labelled,
        csv,
        out,
        as_json=json,
        model=model,
        preset=preset,
        config_path=config,
        like_paper=LikePaper(1.5 if manual_sd is None else manual_sd) if like_paper else None,
        seed=seed,
        study_name=study,
    )


def ablation(
    labelled: Annotated[Path | None, typer.Argument(metavar="SET", help="labelled set as synth writes it")] = None,
    json: JsonOption = False,
    out: Annotated[Path | None, typer.Option(help="folder for ablation.json, ablation.md and ablation_frames.csv")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the true masks instead of the network's")] = False,
    sequence: Annotated[int, typer.Option(min=0, max=100_000, help="also measure streams, of so many frames of the twin")] = 0,
    phantom: Annotated[list[str] | None, typer.Option(help="named phantom of these frames; default: all, in turn")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the bootstrap and of the twin")] = 0,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """What each step is worth: from the paper taken literally to ours, on the same masks of the same frames.

    And, in streams, perception as the window has it, which looks for itself.
    """
    from app.ablation_command import Plan, run_ablation

    check_masks(model, true_masks=true_masks)
    plan = Plan(labelled, model, config, true_masks, sequence, tuple(phantom or ()), seed, out)
    run_ablation(plan, as_json=json)

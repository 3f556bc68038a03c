"""The command line (a contract: scripts and studies rely on it). Errors are one clear line and exit code 2.

What a command takes stands with its family, in ``cli_*.py``; what it does, in a module that is imported only when it is called.

What commands of several families take, said once.

Commands that measure in pictures: perceive, annotate, evaluate, ablation.

Commands on recorded sessions: record, replay, play, session.

Commands that make a model: synth, train, average, calibrate.

Commands that try the program itself, for minutes or hours: trial, benchmark, faults, soak, screenshots.

Commands on a bench: doctor, rig.
"""

from __future__ import annotations

import errno
import faulthandler
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, TextIO

import typer

from core.devices import UserError
from core.files import limit_pictures
from core.system import keep_freed, share_heaps

ConfigOption = Annotated[Path | None, typer.Option("--config", help="TOML file; keys that differ from the defaults are enough")]
PresetOption = Annotated[str | None, typer.Option("--preset", help="'paper' takes the paper literally")]
ModelOption = Annotated[str | None, typer.Option(help="model name or folder")]
SchedulerOption = Annotated[str | None, typer.Option(help="address of a Dask scheduler that takes the place of --workers")]
RigOption = Annotated[
    str | None,
    typer.Option("--rig", help="twin (needs no hardware), realsense, webcam, or a name of rig list; default: the configured one"),
]
JsonOption = Annotated[bool, typer.Option("--json", help="one JSON object on standard output, nothing else there")]
ProgressOption = Annotated[
    bool, typer.Option("--progress-json", help="progress as JSON objects on standard output, one a line, for other programs")
]
SessionArgument = Annotated[Path, typer.Argument(metavar="SESSION", help="folder of a recorded session")]


def check_masks(model: str | None, *, true_masks: bool) -> None:
    """Raise UserError for a model that ``--true-masks`` would never look through."""
    if true_masks and model is not None:
        raise UserError("--true-masks looks through no network: leave --model out")


def tell_asked_progress(asked: bool) -> None:
    """For ``ProgressOption``."""
    if asked:
        from app.commands.progress import tell_progress

        tell_progress()


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
    from app.commands.perceive import Outputs, run_perceive

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
    from app.annotator.sources import AnnotateOptions, StudyOptions
    from app.commands.annotate import run_annotate

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
    from app.commands.evaluate import LikePaper, run_evaluate

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
    from tools.ablation import Plan, run_ablation

    check_masks(model, true_masks=true_masks)
    plan = Plan(labelled, model, config, true_masks, sequence, tuple(phantom or ()), seed, out)
    run_ablation(plan, as_json=json)


def record(
    seconds: Annotated[float, typer.Option(min=0.1, max=86_400.0, help="length of the recording; Ctrl-C ends it sooner")],
    out: Annotated[Path | None, typer.Option(help="folder in which the session is made; default: the configured one")] = None,
    rig: RigOption = None,
    lossless: Annotated[bool, typer.Option("--lossless", help="keep every pixel as it is; a hundred times the size")] = False,
    json: JsonOption = False,
    config: ConfigOption = None,
) -> None:
    """Record a session without a window."""
    from app.commands.session import run_record

    run_record(seconds, out, rig=rig, config_path=config, lossless=lossless, as_json=json)


def replay(
    sessions: Annotated[
        list[Path], typer.Argument(metavar="SESSION", help="folders of recorded sessions, or folders with sessions in them")
    ],
    model: Annotated[str | None, typer.Option(help="model name or folder; default: the recorded configuration's")] = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    jsonl: Annotated[Path | None, typer.Option(help="the new results, one JSON object per frame, as perceive writes them")] = None,
    diff: Annotated[bool, typer.Option("--diff", help="also the frames that changed most")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="folder for replay.json, changes.jsonl and the figure as SVG and PDF; of several sessions a folder each"),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes, which share the sessions")] = 1,
    scheduler: SchedulerOption = None,
    json: Annotated[
        bool, typer.Option("--json", help="one JSON object on standard output, nothing else there; of several sessions a line each")
    ] = False,
) -> None:
    """Perceive recorded sessions again and compare; without --config or --preset in the recorded configuration."""
    from app.commands.replay import ReplayOptions, run_replay, run_replays, sessions_in

    found = sessions_in(sessions)
    options = ReplayOptions(found[0], model, preset, config, jsonl, diff)
    if found == sessions and len(found) == 1 and scheduler is None:
        run_replay(options, out, as_json=json)
    else:
        run_replays(found, options, out, workers=workers, scheduler=scheduler, as_json=json)


def play(
    session: SessionArgument,
    against: Annotated[Path | None, typer.Option(help="results of replay --jsonl, shown beside the recording")] = None,
) -> None:
    """The player: a recorded session with everything that was understood, frame by frame."""
    from app.commands.session import run_play

    sys.exit(run_play(session, against))


session_commands = typer.Typer(help="Recorded sessions: look at them, recover cut ones, export.", no_args_is_help=True)


@session_commands.command("info")
def session_info(session: SessionArgument, json: JsonOption = False) -> None:
    """What a session is, what is in it, and what is wrong with it."""
    from app.commands.session import run_info

    run_info(session, as_json=json)


@session_commands.command("recover")
def session_recover(
    session: SessionArgument,
    into: Annotated[Path | None, typer.Option(help="folder in which the copy is made; default: beside the session")] = None,
    only_look: Annotated[bool, typer.Option("--only-look", help="write nothing; say what would be lost")] = False,
    json: JsonOption = False,
    progress_json: ProgressOption = False,
) -> None:
    """Repair a cut or damaged session into a copy; the original stays as it is."""
    from app.commands.session import run_recover

    tell_asked_progress(progress_json)
    run_recover(session, into, as_json=json, only_look=only_look)


@session_commands.command("export")
def session_export(
    session: SessionArgument,
    out: Annotated[list[Path], typer.Option(help="file.mp4, file.csv or file.mcap; may be repeated")],
    plain: Annotated[bool, typer.Option("--plain", help="MP4 without overlays")] = False,
    json: JsonOption = False,
) -> None:
    """A session as video, table, or MCAP for Foxglove and PlotJuggler."""
    from app.commands.session import run_export

    run_export(session, out, plain=plain, as_json=json)


def synth(
    out: Annotated[Path, typer.Option(help="folder of the set; an interrupted one is continued")],
    count: Annotated[int, typer.Option(min=1, help="frames")],
    seed: Annotated[int, typer.Option(min=0, help="first phantom seed; 16 x --poses frames use one seed")] = 0,
    width: Annotated[int, typer.Option(min=160, max=4096)] = 640,
    height: Annotated[int, typer.Option(min=120, max=4096)] = 480,
    family: Annotated[
        list[str] | None,
        typer.Option(
            help="only these families of looks, rare ones among them (gel, drape, stage_light, glow, tank, picture, resin: drawn "
            "only where they are named), or bench: the twin's own; may be repeated"
        ),
    ] = None,
    phantom: Annotated[str | None, typer.Option(help="one named phantom instead of random ones")] = None,
    poses: Annotated[
        int, typer.Option(min=1, max=8, help="poses of the robot in every look: more frames in the same time, but fewer looks")
    ] = 1,
    workers: Annotated[int, typer.Option(min=1, max=64, help="processes")] = 1,
    scheduler: SchedulerOption = None,
) -> None:
    """Randomised labelled frames from the bench twin: images, masks, truth."""
    from app.commands.train import run_synth

    families = tuple(family) if family else None
    run_synth(out, count, seed, (width, height), families, phantom, poses, workers=workers, scheduler=scheduler)


def train(
    out: Annotated[Path, typer.Option(help="folder of the new model")],
    data: Annotated[list[Path] | None, typer.Option(help="labelled folder as synth writes it; may be repeated")] = None,
    synthetic: Annotated[int, typer.Option(min=0, help="also make this many frames with the twin")] = 0,
    init: Annotated[str | None, typer.Option(help="start from this model instead of from nothing")] = None,
    remember: Annotated[
        int, typer.Option(min=0, help="for few frames of a new look: as often show so many of the twin, that nothing is forgotten")
    ] = 0,
    shallow: Annotated[bool, typer.Option("--shallow", help="a new network of two convolutions on every level")] = False,
    deepen: Annotated[
        bool,
        typer.Option(
            "--deepen",
            help="before training, give the network that learns the depth of the shipped one of its kind",
        ),
    ] = False,
    widen: Annotated[
        bool, typer.Option("--widen", help="with --second-look: before training, give it the width of the shipped one")
    ] = False,
    without: Annotated[
        list[str] | None,
        typer.Option(help="leave out frames of this family of looks, to be tested on; may be repeated"),
    ] = None,
    second_look: Annotated[
        bool, typer.Option("--second-look", help="train the network of the --init model's second look, near the robot's ends")
    ] = False,
    steps: Annotated[int, typer.Option(min=1)] = 6000,
    stop_after: Annotated[int | None, typer.Option(min=1, help="end after so many of the steps, to go on with --init")] = None,
    batch: Annotated[int, typer.Option(min=1, max=512)] = 12,
    rate: Annotated[float, typer.Option(min=1e-6, max=0.1, help="peak learning rate")] = 1e-2,
    crop: Annotated[int, typer.Option(min=64, max=2048, help="side of the training crops, working pixels")] = 256,
    look_share: Annotated[float, typer.Option(min=0, max=1, help="share of the crops whose look is changed at random")] = 1.0,
    strips: Annotated[float, typer.Option(min=0, max=1, help="share of the crops in which clips are laid over the robot")] = 0.0,
    focus: Annotated[
        float, typer.Option(min=0, max=0.9, help="share of the crops that show what the --init model finds hard")
    ] = 0.0,
    end_weight: Annotated[
        float, typer.Option(min=0, max=20, help="how much more than elsewhere a pixel counts near the robot's ends")
    ] = 0.0,
    robot_weight: Annotated[
        float, typer.Option(min=0.1, max=10, help="how much the robot's loss counts beside the vessel's")
    ] = 1.5,
    base: Annotated[
        int | None, typer.Option(min=4, max=128, help="plain U-Net of this base width instead of the folded one")
    ] = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    threads: Annotated[int, typer.Option(min=0, max=256, help="CPU threads; 0 = all")] = 0,
    held_out: Annotated[
        Path | None, typer.Option(help="labelled folder that is not trained on: its Dice before and after goes into the model")
    ] = None,
    progress_json: ProgressOption = False,
) -> None:
    """Train or fine-tune the network; Ctrl-C keeps what was learnt."""
    from app.commands.train import TrainInputs, TrainOutputs, run_train
    from core.learning.training_plan import TrainingPlan

    if remember and (synthetic or not data or init is None):
        raise UserError("--remember N is for --data DIR and --init MODEL, without --synthetic")
    plan = TrainingPlan(
        steps=steps,
        batch=batch,
        learning_rate=rate,
        warmup_steps=min(100, max(1, steps // 10)),
        crop=(crop, crop),
        look_share=look_share,
        strip_share=strips,
        focus_share=focus,
        end_weight=end_weight,
        robot_weight=robot_weight,
        keeps_statistics=remember > 0,
        stop_after=stop_after,
        seed=seed,
        threads=threads,
    )
    tell_asked_progress(progress_json)
    run_train(
        TrainOutputs(out, held_out),
        TrainInputs(data or (), synthetic or remember, without or ()),
        init,
        base,
        plan,
        deepen=deepen,
        shallow=shallow,
        second_look=second_look,
        widen=widen,
    )


def average(
    models: Annotated[list[str], typer.Argument(help="two models or more; one that is named twice counts twice")],
    out: Annotated[Path, typer.Option(help="folder of their mean")],
) -> None:
    """The mean, weight by weight, of models that were trained from each other, such as one before and after fine-tuning.

    Of others of the same shape the mean sees nothing, and nobody checks that. It comes without eight-bit copies and without
    calibration: calibrate SET --eight-bit gives it both.
    """
    from app.commands.average import run_average

    run_average(models, out)


def calibrate(
    folder: Annotated[Path, typer.Argument(help="labelled folder as synth writes it, which training has never seen")],
    model: Annotated[str, typer.Option(help="model in resources/models, or a folder; its model.json is rewritten")] = "default",
    knows: Annotated[
        list[Path] | None, typer.Option("--knows", help="another folder of pictures, labelled or not, of a kind that it knows, too")
    ] = None,
    eight_bit: Annotated[
        bool, typer.Option("--eight-bit", help="first make the networks' eight-bit copies anew, from some of the frames")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Teach a model what its confidence means: the share of right answers among those that it is so sure of.

    And which kinds of pictures it knows: it refuses others from then on (perception.quality.max_novelty).
    """
    from app.commands.calibrate_model import run_calibrate

    run_calibrate(folder, model=model, config_path=config, knows=knows or (), eight_bit=eight_bit)


_FRAMES = 120


def trial(
    seeds: Annotated[str, typer.Option(help="A:B, phantoms, looks, robots and targets A to B - 1")],
    policy: Annotated[
        list[str] | None,
        typer.Option(help="pursuit, table, push or random; may be repeated to compare; default: the configured one"),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes")] = 1,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per trial, then the summary, on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="folder for trials.jsonl and report.html; trials already there are kept")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the twin's own masks instead of the network's")] = False,
    max_seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="simulated time after which a trial has failed")] = 120.0,
    look: Annotated[
        str, typer.Option(help="random: every trial another picture; bench: the default clear one; or a family, as in synth")
    ] = "random",
    scheduler: SchedulerOption = None,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """Closed-loop trials in the bench twin: a policy drives the robot to a target that it has never seen."""
    from app.commands.trial import run_trials

    check_masks(model, true_masks=true_masks)
    run_trials(
        seeds,
        policy or [],
        workers=workers,
        out=out,
        model=model,
        config_path=config,
        true_masks=true_masks,
        max_seconds=max_seconds,
        look=look,
        scheduler=scheduler,
        as_json=json,
    )


def benchmark(
    json: JsonOption = False,
    accuracy: Annotated[Path | None, typer.Option(help="measure accuracy on this synth set instead of speed")] = None,
    window: Annotated[
        float | None,
        typer.Option(min=5.0, max=3600.0, help="measure the window's pace for so many seconds from its first picture on"),
    ] = None,
    recording: Annotated[bool, typer.Option("--recording", help="how much a recording slows perception down, in turns")] = False,
    player: Annotated[
        float | None, typer.Option(min=0.5, max=600.0, help="open a session of so many minutes in the player and seek in it")
    ] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="accuracy of the geometry alone, without the network")] = False,
    store: Annotated[bool, typer.Option("--store", help="keep the accuracy in the model's model.json")] = False,
    frames: Annotated[
        int | None, typer.Option(min=3, max=10_000, help="frames to time, also with --recording; default: 120")
    ] = None,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Latency per stage, throughput, memory and start-up, against the paper-literal baseline in the same run; or accuracy."""
    from app.commands.benchmark import run_accuracy, run_player, run_recording, run_speed, run_window_pace

    asked = {"--window": window is not None, "--player": player is not None, "--recording": recording}
    asked["--accuracy"] = accuracy is not None
    if sum(asked.values()) > 1:
        raise UserError(f"{', '.join(name for name, given in asked.items() if given)} are different things: give one of them")
    if accuracy is None and (store or true_masks):
        raise UserError(f"{'--store' if store else '--true-masks'} is for --accuracy SET")
    if store and (true_masks or preset is not None or config is not None):
        raise UserError("--store keeps figures of the model as it is shipped: leave --true-masks, --preset and --config out")
    check_masks(model, true_masks=true_masks)
    others = [name for name, given in asked.items() if given and name != "--recording"]
    if frames is not None and others:
        raise UserError(f"--frames is for speed and --recording: leave it out with {others[0]}")
    frames = _FRAMES if frames is None else frames
    if window is not None and (model is not None or preset is not None):
        raise UserError("--window runs with the settings of --config: leave --model and --preset out")
    if window is not None:
        run_window_pace(window, config_path=config, as_json=json)
    elif player is not None:
        run_player(player, model=model, preset=preset, config_path=config, as_json=json)
    elif recording:
        run_recording(frames, model=model, preset=preset, config_path=config, as_json=json)
    elif accuracy is not None:
        run_accuracy(accuracy, model=model, preset=preset, config_path=config, as_json=json, store=store, true_masks=true_masks)
    else:
        run_speed(frames, model=model, preset=preset, config_path=config, as_json=json)


def faults(
    only: Annotated[list[int] | None, typer.Option(min=1, help="this fault of the list only; may be repeated")] = None,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per fault on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="also write the table as a page, as docs/faults.md")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="those that need no line, process or window, in lock-step")] = False,
) -> None:
    """Fault campaign: bring all 45 faults about and look for reaction, alert and record."""
    from tools.fault_campaign.bench import run_faults

    sys.exit(run_faults(only or [], out, quick=quick, as_json=json))


def soak(
    hours: Annotated[float, typer.Option(min=0.005, max=1000.0, help="Ctrl-C ends it sooner and tells the figures so far")] = 2.0,
    seed: Annotated[int, typer.Option(min=0, help="of faults and operator")] = 0,
    out: Annotated[Path | None, typer.Option(help="file for the samples and the summary, one JSON object a line")] = None,
    true_masks: Annotated[
        bool, typer.Option("--true-masks", help="the twin's own masks instead of the network's: lighter")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Hours of twin under random faults and operator input: memory, threads, files, records, and every goal on the wire."""
    from tools.soak import run_soak

    sys.exit(run_soak(hours, seed, out, true_masks=true_masks, as_json=json))


def screenshots(
    out: Annotated[Path, typer.Option(help="folder of the pictures")],
    only: Annotated[list[str] | None, typer.Option(help="only this picture; may be repeated")] = None,
    config: ConfigOption = None,
) -> None:
    """The pictures of the documents, from the running program with fixed seeds. No screen is needed."""
    from tools.screenshots import run_screenshots

    run_screenshots(out, only or (), config)


def doctor(
    json: JsonOption = False,
    rig: RigOption = None,
    config: ConfigOption = None,
) -> None:
    """Preflight: program, model, camera, servos, controls, disk, clock; what is wrong, and what to do. Nothing moves."""
    from app.commands.rig import run_doctor

    sys.exit(run_doctor(rig, config, as_json=json))


rig_commands = typer.Typer(help="Rigs: camera, servos and calibration of a bench, in one file.", no_args_is_help=True)
RigName = Annotated[str, typer.Argument(metavar="NAME", help="of the rig")]
SquareOption = Annotated[float, typer.Option(min=2.0, max=100.0, help="side of a square of the board, mm")]
ColumnsOption = Annotated[int, typer.Option(min=4, max=40, help="squares across")]
RowsOption = Annotated[int, typer.Option(min=4, max=40, help="squares down")]


@rig_commands.command("list")
def rig_list(json: JsonOption = False) -> None:
    """The rigs that there are."""
    from app.commands.rig import run_list

    run_list(as_json=json)


@rig_commands.command("show")
def rig_show(name: RigName, json: JsonOption = False) -> None:
    """One rig with its calibration."""
    from app.commands.rig import run_show

    run_show(name, as_json=json)


@rig_commands.command("calibrate")
def rig_calibrate(
    name: RigName,
    auto: Annotated[bool, typer.Option("--auto", help="yes, without help: the servos move by themselves")] = False,
    source: Annotated[
        str | None, typer.Option("--from", help="twin, realsense, webcam or a rig; default: NAME where there is one, else twin")
    ] = None,
    steps: Annotated[str, typer.Option(help="of board,servos,zero,steering")] = "board,servos,zero,steering",
    pictures: Annotated[int, typer.Option(min=1, max=20, help="of the board")] = 5,
    square_mm: SquareOption = 18.0,
    columns: ColumnsOption = 10,
    rows: RowsOption = 7,
    json: JsonOption = False,
    config: ConfigOption = None,
) -> None:
    """Calibrate a rig without a window and save it; with help it goes in the window, menu Rig."""
    from app.commands.rig import CalibrateOptions, run_calibrate
    from core.calibration.camera import BoardSpec

    if not auto:
        raise UserError("say --auto when nobody is in the servos' way; with pictures and buttons: main.py gui, menu Rig, Calibrate")
    chosen = tuple(step.strip() for step in steps.split(",") if step.strip())
    run_calibrate(CalibrateOptions(name, source, config, chosen, pictures, BoardSpec(columns, rows, square_mm), json))


@rig_commands.command("board")
def rig_board(
    out: Annotated[Path, typer.Option(help="board.pdf or board.png")],
    square_mm: SquareOption = 18.0,
    columns: ColumnsOption = 10,
    rows: RowsOption = 7,
) -> None:
    """The calibration board for the printer, at true size."""
    from app.commands.rig import run_board
    from core.calibration.camera import BoardSpec

    run_board(out, BoardSpec(columns, rows, square_mm))


app = typer.Typer(
    name="lumenpilot",
    help="Teleoperation assist for a tendon-driven interventional robot: perception, pose state, advice, and a bench twin.",
    add_completion=False,
    no_args_is_help=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

SourceOption = Annotated[
    Path | None, typer.Option("--source", help="video, picture or folder to look at instead of a rig's camera")
]


_INTERRUPTED = 130


def main() -> None:
    """Run the command line. Known errors end as one line on standard error and exit code 2; Ctrl-C as exit code 130."""
    with suppress(OSError, RuntimeError, ValueError):  # there is not always a standard error
        faulthandler.enable()  # a memory fault says at least where, and not only that
    share_heaps()
    keep_freed()
    limit_pictures()
    if sys.stdout is None:  # started with a closed one: what is told there is told to nobody
        sys.stdout = open(os.devnull, "w")
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # a file's name need not be text that this terminal has
    try:
        try:
            _refuse_empty(sys.argv[1:])
            code = app(prog_name="main.py", standalone_mode=False)
        finally:
            _finish_output()
    except UserError as error:
        _tell(f"error: {error}")
        sys.exit(2)
    except typer.TyperException as error:  # a command line that makes no sense
        if error.format_message().startswith("Usage:"):  # a group by itself: its help is the answer
            _tell(error.format_message())
            sys.exit(2)
        context = getattr(error, "ctx", None)
        told = " ".join(error.format_message().split()).rstrip(".")
        _tell(f"error: {told}; see {context.command_path + ' ' if context is not None else ''}--help")
        sys.exit(2)
    except OSError as error:
        if error.errno == errno.ENOSPC:
            _tell(f"error: {error.filename or 'output'}: the disk is full; make room, or write to another one")
        elif error.filename is not None and error.strerror:
            _tell(f"error: {error.filename}: {error.strerror}")
        else:
            raise
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    if code == _INTERRUPTED:  # Typer gives it back instead of raising
        _tell("interrupted")
    if isinstance(code, int) and code:
        sys.exit(code)


def _refuse_empty(words: Sequence[str]) -> None:
    """No option and no argument takes an empty text: as a path it would mean this folder, and as a name nothing at all.

    But a study without a name is what was measured outside studies.
    """
    for before, word in zip(["", *words], words, strict=False):
        option, has_value, value = word.partition("=") if word.startswith("--") else (before, word == "", word)
        if has_value and not value and option != "--study":
            what = option if option.startswith("-") and option.strip("-") else "an argument"
            raise UserError(f"{what} is empty: give it a value, or leave it out (is a variable of a script not set?)")


def _tell(line: str) -> None:
    """On standard error; where that cannot be written, the exit code says it alone."""
    try:
        sys.stderr.write(line + "\n")
        sys.stderr.flush()
    except OSError:
        _let_go(sys.stderr)


def _let_go(stream: TextIO) -> None:
    """What it still holds goes nowhere: the interpreter would try again at its end, and change the exit code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _finish_output() -> None:
    """What standard output still holds is written while an error of it can be told; at the interpreter's end nobody could."""
    if sys.stdout is None:
        return
    try:
        sys.stdout.flush()
    except OSError as error:
        _let_go(sys.stdout)
        if error.errno != errno.EPIPE:
            raise


@app.callback(invoke_without_command=True)
def _window(context: typer.Context, rig: RigOption = None, config: ConfigOption = None, source: SourceOption = None) -> None:
    """Without a command: the operator window."""
    if context.invoked_subcommand is None:
        _open_window(rig, config, source)
    given = [name for name, value in (("--rig", rig), ("--config", config), ("--source", source)) if value is not None]
    if given:
        command = context.invoked_subcommand
        raise UserError(f"{given[0]} before {command} is for the window alone; write it behind, where {command} takes it")


def gui(
    rig: RigOption = None,
    config: ConfigOption = None,
    source: SourceOption = None,
    tour: Annotated[bool, typer.Option("--tour", help="show the tour, as at the first start")] = False,
    until_first_frame: Annotated[bool, typer.Option("--until-first-frame", hidden=True)] = False,
) -> None:
    """The operator window (the same as no command)."""
    _open_window(rig, config, source, until_first_frame, tour=tour)


def _open_window(
    rig: str | None, config_path: Path | None, source: Path | None, until_first_frame: bool = False, *, tour: bool = False
) -> None:
    from app.operator.startup import run_window

    sys.exit(run_window(rig, config_path, source, until_first_frame=until_first_frame, tour=tour))


# --help lists them in this order, and the groups after them
for _command in (
    gui,
    perceive,
    synth,
    train,
    average,
    calibrate,
    annotate,
    evaluate,
    trial,
    benchmark,
    record,
    replay,
    play,
    ablation,
    screenshots,
    faults,
    soak,
    doctor,
):
    app.command()(_command)
app.add_typer(session_commands, name="session")
app.add_typer(rig_commands, name="rig")

"""The command line (a contract: scripts and studies rely on it). Errors are one clear line and exit code 2."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from core.errors import UserError

app = typer.Typer(
    name="lumenpilot",
    help="Teleoperation assist for a tendon-driven interventional robot: perception, pose state, advice, and a bench twin.",
    add_completion=False,
    no_args_is_help=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ConfigOption = Annotated[Path | None, typer.Option("--config", help="TOML file; keys that differ from the defaults are enough")]
PresetOption = Annotated[str | None, typer.Option("--preset", help="'paper' takes the paper literally")]
RigOption = Annotated[
    str | None,
    typer.Option("--rig", help="twin (needs no hardware), realsense, webcam, or a name of rig list; default: the configured one"),
]
SourceOption = Annotated[Path | None, typer.Option("--source", help="video, picture or folder to look at instead of a camera")]
JsonOption = Annotated[bool, typer.Option("--json", help="one JSON object on standard output, nothing else there")]
ProgressOption = Annotated[
    bool, typer.Option("--progress-json", help="progress as JSON objects on standard output, one a line, for other programs")
]


def main() -> None:
    """Run the command line. Known errors end as one line on standard error and exit code 2; Ctrl-C as exit code 130."""
    try:
        app()
    except UserError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)


@app.callback(invoke_without_command=True)
def _window(context: typer.Context, rig: RigOption = None, config: ConfigOption = None, source: SourceOption = None) -> None:
    """Without a command: the operator window."""
    if context.invoked_subcommand is None:
        _open_window(rig, config, source)


@app.command()
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
    from app.window_command import run_window

    sys.exit(run_window(rig, config_path, source, until_first_frame=until_first_frame, tour=tour))


def _tell_progress(asked: bool) -> None:
    if asked:
        from app.progress_lines import tell_progress

        tell_progress()


@app.command()
def perceive(
    images: Annotated[list[Path], typer.Argument(help="pictures, folders of pictures, or videos")],
    jsonl: Annotated[Path | None, typer.Option(help="one JSON object per image; default: standard output")] = None,
    masks: Annotated[Path | None, typer.Option(help="folder for <stem>_vessel.png and <stem>_robot.png")] = None,
    targets: Annotated[Path | None, typer.Option(help='JSON {"stem": [x, y]}: where the operator wants to go')] = None,
    overlay: Annotated[Path | None, typer.Option(help="folder for pictures with everything drawn in")] = None,
    model: Annotated[str | None, typer.Option(help="model name or folder")] = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Vessel, robot, angle, distances and pose state of pictures or a video."""
    from app.perceive_command import Outputs, run_perceive

    run_perceive(images, Outputs(jsonl, masks, overlay), targets_path=targets, model=model, preset=preset, config_path=config)


@app.command()
def synth(
    out: Annotated[Path, typer.Option(help="folder of the set; an interrupted one is continued")],
    count: Annotated[int, typer.Option(min=1, help="frames")],
    seed: Annotated[int, typer.Option(min=0, help="first phantom seed; sixteen frames use one seed")] = 0,
    width: Annotated[int, typer.Option(min=160, max=4096)] = 640,
    height: Annotated[int, typer.Option(min=120, max=4096)] = 480,
    family: Annotated[list[str] | None, typer.Option(help="only these families of looks")] = None,
    phantom: Annotated[str | None, typer.Option(help="one named phantom instead of random ones")] = None,
    workers: Annotated[int, typer.Option(min=1, max=64)] = 1,
) -> None:
    """Randomised labelled frames from the bench twin: images, masks, truth."""
    from app.learning_commands import run_synth

    run_synth(out, count, seed, (width, height), tuple(family) if family else None, phantom, workers)


@app.command()
def train(
    out: Annotated[Path, typer.Option(help="folder of the new model")],
    data: Annotated[list[Path] | None, typer.Option(help="labelled folder as synth writes it; may be repeated")] = None,
    synthetic: Annotated[int, typer.Option(min=0, help="also make this many frames with the twin")] = 0,
    init: Annotated[str | None, typer.Option(help="start from this model instead of from nothing")] = None,
    remember: Annotated[
        int, typer.Option(min=0, help="for few frames of a new look: as often show so many of the twin, that nothing is forgotten")
    ] = 0,
    shallow: Annotated[bool, typer.Option("--shallow", help="a new network of two convolutions on every level")] = False,
    deepen: Annotated[bool, typer.Option("--deepen", help="give the --init network the default's depth before training")] = False,
    second_look: Annotated[
        bool, typer.Option("--second-look", help="train the network of the --init model's second look, near the robot's ends")
    ] = False,
    steps: Annotated[int, typer.Option(min=1)] = 6000,
    stop_after: Annotated[int | None, typer.Option(min=1, help="end after so many of the steps, to go on with --init")] = None,
    batch: Annotated[int, typer.Option(min=1, max=512)] = 12,
    rate: Annotated[float, typer.Option(min=1e-6, max=0.1, help="peak learning rate")] = 1e-2,
    crop: Annotated[int, typer.Option(min=64, max=2048, help="side of the training crops, working pixels")] = 256,
    look_share: Annotated[float, typer.Option(min=0, max=1, help="share of the crops whose look is changed at random")] = 1.0,
    focus: Annotated[
        float, typer.Option(min=0, max=0.9, help="share of the crops from frames that the --init model finds hard")
    ] = 0.0,
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
    from app.learning_commands import TrainOutputs, run_train
    from core.errors import UserError
    from core.learning.training import TrainingPlan

    if remember and (synthetic or not data or init is None):
        raise UserError("--remember N is for --data DIR and --init MODEL, without --synthetic")
    plan = TrainingPlan(
        steps=steps,
        batch=batch,
        learning_rate=rate,
        warmup_steps=min(100, max(1, steps // 10)),
        crop=(crop, crop),
        look_share=look_share,
        focus_share=focus,
        keeps_statistics=remember > 0,
        stop_after=stop_after,
        seed=seed,
        threads=threads,
    )
    _tell_progress(progress_json)
    run_train(
        TrainOutputs(out, held_out),
        data or [],
        synthetic or remember,
        init,
        base,
        plan,
        deepen=deepen,
        shallow=shallow,
        second_look=second_look,
    )


@app.command()
def calibrate(
    folder: Annotated[Path, typer.Argument(help="labelled folder as synth writes it, which training has never seen")],
    model: Annotated[str, typer.Option(help="model in resources/models, or a folder; its model.json is rewritten")] = "default",
    config: ConfigOption = None,
) -> None:
    """Teach a model what its confidence means: the share of right answers among those that it is so sure of."""
    from app.calibrate_command import run_calibrate

    run_calibrate(folder, model=model, config_path=config)


@app.command()
def annotate(
    paths: Annotated[list[Path] | None, typer.Argument(help="folders, pictures, videos or sessions; default: this folder")] = None,
    store: Annotated[Path | None, typer.Option(help="annotation file; default: annotations.lumenpilot.sqlite there")] = None,
    rater: Annotated[str | None, typer.Option(help="who annotates; default: the user's name")] = None,
    study: Annotated[str, typer.Option(help="blind study of this name: begun at the first call, gone on with at later ones")] = "",
    repeats: Annotated[int | None, typer.Option(min=1, max=20, help="how often a study shows each image; default: 2")] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="repeats of a study are shown mirrored")] = False,
    turn: Annotated[bool, typer.Option("--turn", help="repeats of a study are shown turned by 180 degrees")] = False,
    order: Annotated[str | None, typer.Option(help="listed, random, worst (least sure first) or even (evenly over time)")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="of the shuffled order")] = None,
    frames: Annotated[int, typer.Option(min=1, max=100_000, help="pictures taken of each video, evenly over time")] = 48,
    report: Annotated[bool, typer.Option("--report", help="agreement within and between raters, instead of the window")] = False,
    export: Annotated[str | None, typer.Option(help="dataset (for train), csv (for evaluate) or coco, to --out")] = None,
    import_: Annotated[list[Path] | None, typer.Option("--import", help="labelme or COCO file or folder; may be repeated")] = None,
    salvage: Annotated[bool, typer.Option("--salvage", help="copy what is readable of a damaged annotation file")] = False,
    out: Annotated[Path | None, typer.Option(help="where report or export go")] = None,
    json: JsonOption = False,
    model: Annotated[str | None, typer.Option(help="model name or folder")] = None,
    config: ConfigOption = None,
) -> None:
    """Measure angles and states by hand, draw masks; as a study with several raters, blind and repeated."""
    from app.annotate_command import AnnotateOptions, StudyOptions, run_annotate

    options = AnnotateOptions(
        paths=tuple(paths or ()),
        store=store,
        study=StudyOptions(study, rater, repeats, mirror, turn, seed, order),
        frames=frames,
        report=report,
        export=export,
        imports=tuple(import_ or ()),
        salvage=salvage,
        out=out,
        as_json=json,
        model=model,
        config_path=config,
    )
    sys.exit(run_annotate(options))


@app.command()
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
    manual_sd: Annotated[float, typer.Option(min=0, max=30, help="SD of one such manual measure, degrees")] = 1.5,
    study: Annotated[str | None, typer.Option(help="this study of images annotated by hand, its raters and repeats too")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the drawn images, their manual errors and the bootstrap")] = 0,
    model: Annotated[str | None, typer.Option(help="model name or folder")] = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    progress_json: ProgressOption = False,
) -> None:
    """The algorithm against manual measures, with the statistics of the paper beside its own figures."""
    from app.evaluate_command import LikePaper, run_evaluate

    _tell_progress(progress_json)
    run_evaluate(
        labelled,
        csv,
        out,
        as_json=json,
        model=model,
        preset=preset,
        config_path=config,
        like_paper=LikePaper(manual_sd) if like_paper else None,
        seed=seed,
        study_name=study,
    )


@app.command()
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
    look: Annotated[str, typer.Option(help="random: every trial another picture; bench: the default clear one")] = "random",
    scheduler: Annotated[str | None, typer.Option(help="address of a Dask scheduler that takes the place of --workers")] = None,
    model: Annotated[str | None, typer.Option(help="model name or folder")] = None,
    config: ConfigOption = None,
) -> None:
    """Closed-loop trials in the bench twin: a policy drives the robot to a target that it has never seen."""
    from app.trial_command import run_trials

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


@app.command()
def benchmark(
    json: JsonOption = False,
    accuracy: Annotated[Path | None, typer.Option(help="measure accuracy on this synth set instead of speed")] = None,
    window: Annotated[float | None, typer.Option(min=5.0, help="run the window for so many seconds and measure its pace")] = None,
    recording: Annotated[bool, typer.Option("--recording", help="how much a recording slows perception down, in turns")] = False,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="accuracy of the geometry alone, without the network")] = False,
    store: Annotated[bool, typer.Option("--store", help="keep the accuracy in the model's model.json")] = False,
    frames: Annotated[int, typer.Option(min=3, max=10_000, help="frames to time")] = 120,
    model: Annotated[str | None, typer.Option(help="model name or folder")] = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Latency per stage, throughput, memory and start-up, against the paper-literal baseline in the same run; or accuracy."""
    from app.benchmark_command import run_accuracy, run_recording, run_speed, run_window_pace

    if window is not None:
        run_window_pace(window, config_path=config, as_json=json)
    elif recording:
        run_recording(frames, model=model, preset=preset, config_path=config, as_json=json)
    elif accuracy is not None:
        run_accuracy(accuracy, model=model, preset=preset, config_path=config, as_json=json, store=store, true_masks=true_masks)
    else:
        run_speed(frames, model=model, preset=preset, config_path=config, as_json=json)


@app.command()
def record(
    seconds: Annotated[float, typer.Option(min=0.1, max=86_400.0, help="length of the recording; Ctrl-C ends it sooner")],
    out: Annotated[Path | None, typer.Option(help="folder in which the session is made; default: the configured one")] = None,
    rig: RigOption = None,
    lossless: Annotated[bool, typer.Option("--lossless", help="keep every pixel as it is; a hundred times the size")] = False,
    json: JsonOption = False,
    config: ConfigOption = None,
) -> None:
    """Record a session without a window."""
    from app.record_command import run_record

    run_record(seconds, out, rig=rig, config_path=config, lossless=lossless, as_json=json)


@app.command()
def replay(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="folder of a recorded session")],
    model: Annotated[str | None, typer.Option(help="model name or folder; default: the recorded configuration's")] = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    jsonl: Annotated[Path | None, typer.Option(help="the new results, one JSON object per frame, as perceive writes them")] = None,
    diff: Annotated[bool, typer.Option("--diff", help="also the frames that changed most")] = False,
    out: Annotated[Path | None, typer.Option(help="folder for replay.json, frames.jsonl and the figure as SVG and PDF")] = None,
    json: JsonOption = False,
) -> None:
    """Perceive a recorded session again and compare; without --config or --preset in the recorded configuration."""
    from app.replay_command import ReplayOptions, run_replay

    run_replay(ReplayOptions(session, model, preset, config, jsonl, out, diff, json))


@app.command()
def play(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="folder of a recorded session")],
    against: Annotated[Path | None, typer.Option(help="results of replay --jsonl, shown beside the recording")] = None,
) -> None:
    """The player: a recorded session with everything that was understood, frame by frame."""
    from app.play_command import run_play

    sys.exit(run_play(session, against))


session_commands = typer.Typer(help="Recorded sessions: look at them, recover cut ones, export.", no_args_is_help=True)
app.add_typer(session_commands, name="session")
SessionArgument = Annotated[Path, typer.Argument(metavar="SESSION", help="folder of a recorded session")]


@session_commands.command("info")
def session_info(session: SessionArgument, json: JsonOption = False) -> None:
    """What a session is, what is in it, and what is wrong with it."""
    from app.session_command import run_info

    run_info(session, as_json=json)


@session_commands.command("recover")
def session_recover(
    session: SessionArgument,
    into: Annotated[Path | None, typer.Option(help="folder of the copy; default: beside the session")] = None,
    only_look: Annotated[bool, typer.Option("--only-look", help="write nothing; say what would be lost")] = False,
    json: JsonOption = False,
    progress_json: ProgressOption = False,
) -> None:
    """Repair a cut or damaged session into a copy; the original stays as it is."""
    from app.session_command import run_recover

    _tell_progress(progress_json)
    run_recover(session, into, as_json=json, only_look=only_look)


@session_commands.command("export")
def session_export(
    session: SessionArgument,
    out: Annotated[list[Path], typer.Option(help="file.mp4, file.csv or file.mcap; may be repeated")],
    plain: Annotated[bool, typer.Option("--plain", help="MP4 without overlays")] = False,
    json: JsonOption = False,
) -> None:
    """A session as video, table, or MCAP for Foxglove and PlotJuggler."""
    from app.session_command import run_export

    run_export(session, out, plain=plain, as_json=json)


@app.command()
def ablation(
    labelled: Annotated[Path | None, typer.Argument(metavar="SET", help="labelled set as synth writes it")] = None,
    json: JsonOption = False,
    out: Annotated[Path | None, typer.Option(help="folder for ablation.json, ablation.md and ablation_frames.csv")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the true masks instead of the network's")] = False,
    sequence: Annotated[int, typer.Option(min=0, max=100_000, help="also measure tracking on so many frames of the twin")] = 0,
    phantom: Annotated[list[str] | None, typer.Option(help="named phantom of these frames; default: all, in turn")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the bootstrap and of the twin")] = 0,
    model: Annotated[str | None, typer.Option(help="model name or folder")] = None,
    config: ConfigOption = None,
) -> None:
    """What each step is worth: from the paper taken literally to ours, on the same masks of the same frames."""
    from app.ablation_command import Plan, run_ablation

    plan = Plan(labelled, model, config, true_masks, sequence, tuple(phantom or ()), seed, out)
    run_ablation(plan, as_json=json)


@app.command()
def screenshots(
    out: Annotated[Path, typer.Option(help="folder of the pictures")],
    only: Annotated[list[str] | None, typer.Option(help="only this picture; may be repeated")] = None,
    config: ConfigOption = None,
) -> None:
    """The pictures of the documents, from the running program with fixed seeds. No screen is needed."""
    from app.screenshots_command import run_screenshots

    run_screenshots(out, only or (), config)


rig_commands = typer.Typer(help="Rigs: camera, servos and calibration of a bench, in one file.", no_args_is_help=True)
app.add_typer(rig_commands, name="rig")
RigName = Annotated[str, typer.Argument(metavar="NAME", help="of the rig")]
SquareOption = Annotated[float, typer.Option(min=2.0, max=100.0, help="side of a square of the board, mm")]
ColumnsOption = Annotated[int, typer.Option(min=4, max=40, help="squares across")]
RowsOption = Annotated[int, typer.Option(min=4, max=40, help="squares down")]


@rig_commands.command("list")
def rig_list(json: JsonOption = False) -> None:
    """The rigs that there are."""
    from app.rig_command import run_list

    run_list(as_json=json)


@rig_commands.command("show")
def rig_show(name: RigName, json: JsonOption = False) -> None:
    """One rig with its calibration."""
    from app.rig_command import run_show

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
    from app.rig_command import CalibrateOptions, run_calibrate
    from core.calibration.board import BoardSpec

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
    from app.rig_command import run_board
    from core.calibration.board import BoardSpec

    run_board(out, BoardSpec(columns, rows, square_mm))


@app.command()
def faults(
    only: Annotated[list[int] | None, typer.Option(min=1, help="this fault of the list only; may be repeated")] = None,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per fault on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="also write the table as a page, as docs/faults.md")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="those that need no line, process or window, in lock-step")] = False,
) -> None:
    """Fault campaign: bring all 42 faults about and look for reaction, alert and record."""
    from app.faults_command import run_faults

    sys.exit(run_faults(only or [], out, quick=quick, as_json=json))


@app.command()
def soak(
    hours: Annotated[float, typer.Option(min=0.005, max=1000.0, help="Ctrl-C ends it sooner, with the figures so far")] = 2.0,
    seed: Annotated[int, typer.Option(min=0, help="of faults and operator")] = 0,
    out: Annotated[Path | None, typer.Option(help="file for the samples and the summary, one JSON object a line")] = None,
    true_masks: Annotated[
        bool, typer.Option("--true-masks", help="the twin's own masks instead of the network's: lighter")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Hours of twin under random faults and operator input: memory, threads, files, records, and every goal on the wire."""
    from app.soak_command import run_soak

    sys.exit(run_soak(hours, seed, out, true_masks=true_masks, as_json=json))


@app.command()
def doctor(
    json: JsonOption = False,
    rig: RigOption = None,
    config: ConfigOption = None,
) -> None:
    """Preflight: program, model, camera, servos, controls, disk, clock; what is wrong, and what to do. Nothing moves."""
    from app.doctor_command import run_doctor

    sys.exit(run_doctor(rig, config, as_json=json))

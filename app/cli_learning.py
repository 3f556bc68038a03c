"""Commands that make a model: synth, train, average, calibrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli_options import ConfigOption, ProgressOption, SchedulerOption, tell_asked_progress
from core.errors import UserError


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
    from app.synth_command import run_synth

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
    from app.train_command import TrainInputs, TrainOutputs, run_train
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
    from app.average_command import run_average

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
    from app.calibrate_command import run_calibrate

    run_calibrate(folder, model=model, config_path=config, knows=knows or (), eight_bit=eight_bit)

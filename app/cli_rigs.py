"""Commands on a bench: doctor, rig."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli_options import ConfigOption, JsonOption, RigOption
from core.errors import UserError


def doctor(
    json: JsonOption = False,
    rig: RigOption = None,
    config: ConfigOption = None,
) -> None:
    """Preflight: program, model, camera, servos, controls, disk, clock; what is wrong, and what to do. Nothing moves."""
    from app.doctor_command import run_doctor

    sys.exit(run_doctor(rig, config, as_json=json))


rig_commands = typer.Typer(help="Rigs: camera, servos and calibration of a bench, in one file.", no_args_is_help=True)
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

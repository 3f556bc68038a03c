"""``rig``: list and show rigs, calibrate one without a window, identify its robot, and print the board."""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.accept import accept_rig, acceptance_lines, config_of
from app.commands.options import ConfigOption, JsonOption, SessionArgument
from app.commands.progress import progress_bar
from app.commands.workers import over_processes
from app.ui.texts import calibrated_parts, calibration_lines, rig_line
from core.calibration.camera import BoardError, BoardSpec
from core.config.acceptance import read_acceptance
from core.config.calibration import BehaviourConfig, DrumsConfig
from core.config.models import Config
from core.config.rig_file import (
    RESERVED,
    RigFile,
    check_can_save,
    check_rig_name,
    find_rig,
    has_rig,
    list_rigs,
    rigs_folder,
    set_behaviour,
    with_rig,
    write_rig,
)
from core.config.safety import JointKind, ServosConfig
from core.devices import UserError
from core.program import CALLED
from core.session.reader import SessionReader
from hardware.rig import RigKind, kind_of, rig_config

if TYPE_CHECKING:
    from hardware.calibration.rig_draft import RigDraft

STEPS = ("board", "servos", "zero", "steering")
_MOVING = frozenset({"servos", "zero", "steering"})
"""Steps that turn servos."""
_BOARD_TRIES = 4
"""Pictures of the board that may fail."""
_WELL_MM = 1.5
"""An identified robot's head is predicted so well (95 %), or something was in its way."""

RigName = Annotated[str, typer.Argument(metavar="NAME", help="of the rig")]
SquareOption = Annotated[float, typer.Option(min=2.0, max=100.0, help="side of a square of the board, mm")]
ColumnsOption = Annotated[int, typer.Option(min=4, max=40, help="squares across")]
RowsOption = Annotated[int, typer.Option(min=4, max=40, help="squares down")]

rig = typer.Typer(help="Rigs: camera, servos and calibration of a bench, in one file.", no_args_is_help=True)


@rig.command("list")
def print_list(as_json: JsonOption = False) -> None:
    """The rigs that there are."""
    listed = list_rigs()
    if as_json:
        rows = []
        for one in listed:
            row: dict[str, Any] = {"name": one.name, "path": str(one.path), "problem": one.problem or None}
            brief: dict[str, Any] = {"kind": None, "robot": None, "made_utc": None, "calibrated": []}
            if one.rig is not None:
                brief = {"kind": one.rig.kind, "robot": one.rig.robot, "made_utc": one.rig.made_utc.isoformat()}
                brief["calibrated"] = calibrated_parts(one.rig)
            rows.append(row | brief)
        sys.stdout.write(json.dumps({"folder": str(rigs_folder()), "built_in": list(RESERVED), "rigs": rows}) + "\n")
        return
    for one in listed:
        sys.stdout.write(f"{one.name}: {rig_line(one.rig) if one.rig is not None else one.problem}\n")
    if not listed:
        sys.stdout.write(
            f"no rig files in {rigs_folder()}; make one: {CALLED} rig calibrate NAME --auto, or menu Rig in the window\n"
        )


@rig.command("show")
def show(name: RigName, as_json: JsonOption = False) -> None:
    """One rig with its calibration."""
    _print_rig(*find_rig(name), as_json=as_json)


def _print_rig(path: Path, found: RigFile, notes: list[str] | None = None, *, as_json: bool) -> None:
    if as_json:
        result = {"path": str(path)} | ({} if notes is None else {"notes": notes})
        sys.stdout.write(json.dumps({**result, **found.model_dump(mode="json")}) + "\n")
    else:
        lines = [f"{found.name} ({path})", rig_line(found), *calibration_lines(found), *(notes or [])]
        lines += behaviour_lines(found.behaviour, found.servos) if found.behaviour is not None else []
        if found.robot == "servos":
            lines += acceptance_lines(read_acceptance(path), config_of(path, found))
        sys.stdout.write("\n".join(lines) + "\n")


@rig.command("calibrate")
def calibrate_rig(
    name: RigName,
    auto: Annotated[bool, typer.Option("--auto", help="yes, without help: the servos move by themselves")] = False,
    source: Annotated[
        str | None,
        typer.Option("--from", help="twin, realsense, webcam, basler or a rig; default: NAME where there is one, else twin"),
    ] = None,
    steps: Annotated[str, typer.Option(help="of board,servos,zero,steering")] = "board,servos,zero,steering",
    drums: Annotated[
        str | None,
        typer.Option(
            help="diameters in mm, measured: of the tendons' drums, the feed's wheel, the delivery's if there is one; "
            "of a screw: its lead over pi",
            metavar="TENDONS,FEED,DELIVERY",
        ),
    ] = None,
    pictures: Annotated[int, typer.Option(min=1, max=20, help="of the board")] = 5,
    square_mm: SquareOption = 18.0,
    columns: ColumnsOption = 10,
    rows: RowsOption = 7,
    as_json: JsonOption = False,
    config_path: ConfigOption = None,
) -> None:
    """Calibrate a rig without a window and save it; with help it goes in the window, menu Rig."""
    from app.operator.rig_engine import quick_sight
    from hardware.calibration.bench import open_bench
    from hardware.calibration.rig_draft import DRUMS_FIRST, RigDraft

    if not auto:
        raise UserError("say --auto when nobody is in the servos' way; with pictures and buttons: main.py gui, menu Rig, Calibrate")
    chosen = tuple(step.strip() for step in steps.split(",") if step.strip())
    config, earlier = _config_to_calibrate(name, source, chosen, config_path)
    measured = _drums(drums)
    calibration = earlier.calibration if earlier is not None else None
    if measured is None and (calibration is None or calibration.drums is None):
        if kind_of(config.rig) is RigKind.LIVE and set(chosen) & _MOVING:
            raise UserError(DRUMS_FIRST)
    check_can_save(name)
    bench = open_bench(config, quick_sight(config))
    done: list[str] = []
    ended: UserError | KeyboardInterrupt | None = None
    try:
        draft = RigDraft(bench, config, calibration, _report)
        if measured is not None:
            draft.set_drums(measured)
        draft.spec = BoardSpec(columns, rows, square_mm)
        bench.warm_up()
        for step in calibration_steps(draft, chosen, pictures):
            done.append(step)
    except (UserError, KeyboardInterrupt) as error:
        if not done:
            raise
        ended = error
    finally:
        bench.close()
    if draft.zero is None and "zero" in done:  # a servo failed afterwards: the wires' places are unknown
        done.remove("zero")
    saved = draft.rig_file(name)
    path = write_rig(saved)
    if ended is not None:  # the steps that were done are saved
        left = ",".join(step for step in STEPS if step in chosen and step not in done)
        kept = f"{' and '.join(done)} saved in {path}; go on: rig calibrate {shlex.quote(saved.name)} --auto --steps {left}"
        if isinstance(ended, UserError):
            raise UserError(f"{ended}; {kept}")
        _report(kept)
        raise ended
    _print_rig(path, saved, draft.notes, as_json=as_json)


def calibration_steps(draft: RigDraft, steps: tuple[str, ...], pictures: int) -> Iterator[str]:
    """Make the steps in their order; each is named when its result can be saved. Raises what the draft raises."""
    if "board" in steps:
        draft.forget_boards()
        failures = 0
        while len(draft.views) < pictures:
            try:
                draft.take_board()
            except BoardError:
                failures += 1
                if failures > _BOARD_TRIES:
                    raise
        draft.solve_boards()
        yield "board"
    if set(steps) & _MOVING:
        if "board" in steps and draft.bench.kind is not RigKind.SIM:  # the twin's board lies in the pictures of it only
            draft.wait_for_no_board()
        draft.search_servos()
    if "servos" in steps:
        draft.identify()
        yield "servos"
    if "zero" in steps:
        zeros = draft.find_zeros()
        if zeros.problems:  # pulling on from there would measure from an unknown place
            raise UserError(f"no zero for all tendons: {'; '.join(zeros.problems)}")
        if draft.zero is not None:
            yield "zero"
    if "steering" in steps:
        was_kept = draft.zero is not None
        draft.learn_steering()  # stores where the tendons were left, too
        yield from ["steering"] if was_kept or "zero" not in steps else ["zero", "steering"]


rig.command("accept")(accept_rig)


@rig.command("identify")
def identify_robot(
    session: SessionArgument,
    kept_in: Annotated[str | None, typer.Option("--rig", help="keep it in the file of this rig, for the twin of its bench")] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes")] = min(2, os.cpu_count() or 1),
    as_json: JsonOption = False,
) -> None:
    """How the robot follows its servos, from a recorded jog of a minute: docs/bench.md says how to drive it."""
    from hardware.twin.identification import RUNS, bench_of_session, identify, jog_of_session

    rig_file = find_rig(kept_in)[0] if kept_in is not None else None
    with SessionReader(session) as reader:
        bench = bench_of_session(reader, rig_file.stem if rig_file is not None else None)
        jog = jog_of_session(reader, bench)
        assert reader.manifest is not None
        servos = ServosConfig.model_validate(reader.manifest.config["servos"])
    with progress_bar() as bar:
        task = bar.add_task("runs of the twin", total=RUNS)

        def spread(function: Any, tasks: Any) -> Iterator[Any]:
            for result in over_processes(workers, function, tasks):
                bar.advance(task)
                yield result

        found = identify(bench.phantom, jog, session.name, servos, spread)
    if rig_file is not None:
        set_behaviour(rig_file, found)
    if as_json:
        sys.stdout.write(json.dumps({"kept": str(rig_file) if rig_file else None, **found.model_dump(mode="json")}) + "\n")
        return
    kept = f"kept in {rig_file}" if rig_file else "not kept; --rig NAME keeps it in the rig's file"
    sys.stdout.write("\n".join([*behaviour_lines(found, servos), kept]) + "\n")


def behaviour_lines(found: BehaviourConfig, servos: ServosConfig) -> list[str]:
    """What was identified, a line each, and how well it predicts."""
    turn_mm = sum(joint.mm_per_turn for joint in servos.joints[servos.places(JointKind.ADVANCE)])
    rows = [
        ("bend to the right", found.bend_right_deg_per_mm, 1.0, ".1f", "deg per mm of pull"),
        ("bend to the left", found.bend_left_deg_per_mm, 1.0, ".1f", "deg per mm of pull"),
        ("slack to the right", found.slack_right_mm, 1.0, ".3f", "mm"),
        ("slack to the left", found.slack_left_mm, 1.0, ".3f", "mm"),
        ("play", found.play_mm, 1.0, ".3f", "mm"),
        ("stiffness of the shaft", found.shaft_to_head, 1.0, ".1f", "times the head's"),
        ("feed", found.feed_share, turn_mm, ".2f", "mm per turn"),
        ("slip forward", found.feed_slip, 100.0, ".1f", "%"),
        ("delay", found.delay_s, 1000.0, ".0f", "ms"),
    ]
    lines = [
        f"{name + ':':24}{scale * one.value:{form}} {unit} ({scale * one.low:{form}} to {scale * one.high:{form}})"
        for name, one, scale, form, unit in rows
    ]
    lines.append(
        f"head path of the half that was not fitted: {found.head_p50_mm:.2f} mm off (50 %), {found.head_p95_mm:.2f} (95 %)"
    )
    if found.head_p95_mm > _WELL_MM:
        lines.append(f"above {_WELL_MM:g} mm some of this is wrong: record another jog, where the head bends freely")
    return lines


@rig.command("restore-servos")
def restore_servos(name: RigName) -> None:
    """Write the servos' EEPROM back as it was before this program changed it; nothing moves, and the torque must be off."""
    from hardware.servos.eeprom import backups_folder, restore_eeprom

    _, found = find_rig(name)
    if found.robot != "servos":
        raise UserError(f"rig {found.name} has no servos of its own")
    if found.servos.driver != "dynamixel":
        raise UserError(f"rig {found.name} has a {found.servos.driver}, which has no EEPROM to restore")
    restore_eeprom(found.servos, backups_folder(), lambda line: sys.stdout.write(f"{line}\n"))


@rig.command("board")
def print_board_file(
    out: Annotated[Path, typer.Option(help="board.pdf or board.png")],
    square_mm: SquareOption = 18.0,
    columns: ColumnsOption = 10,
    rows: RowsOption = 7,
) -> None:
    """The calibration board for the printer, at true size."""
    from app.rig_wizard.board_print import print_board

    paper = print_board(out, BoardSpec(columns, rows, square_mm))
    sys.stdout.write(f"{out}\n")
    sys.stderr.write(f"print it on {paper} at 100 %, and measure the line of 100 mm on it\n")


def _config_to_calibrate(
    name: str, source: str | None, steps: tuple[str, ...], config_path: Path | None
) -> tuple[Config, RigFile | None]:
    """The configuration to calibrate, and the rig that it comes from."""
    try:
        name = check_rig_name(name)
    except ValueError as error:
        raise UserError(str(error)) from None
    if not steps:
        raise UserError(f"--steps names no step; known: {', '.join(STEPS)}")
    if unknown := set(steps) - set(STEPS):
        raise UserError(f"unknown step {sorted(unknown)[0]!r}; known: {', '.join(STEPS)}")
    if source is None:
        source = name if has_rig(name) else "twin"
    if source in RESERVED:
        return rig_config(source, config_path, None)[0], None
    path, found = find_rig(source)
    return with_rig(rig_config(None, config_path, None)[0], found, path), found


def _drums(text: str | None) -> DrumsConfig | None:
    """The drums of ``--drums``. Raises UserError."""
    if text is None:
        return None
    try:
        tendons_mm, advance_mm, *delivery = map(float, text.split(","))
        (delivery_mm,) = delivery or [advance_mm]
        return DrumsConfig(tendons_mm=tendons_mm, advance_mm=advance_mm, delivery_mm=delivery_mm)
    except ValueError:  # pydantic's, too
        raise UserError(f"--drums {text}: diameters in mm of 0.3 to 150: tendons, feed, delivery if there is one") from None


def _report(line: str) -> None:
    sys.stderr.write(f"{line}\n")

"""``rig``: list and show rigs, calibrate one without a window, and print the board.

``doctor``: the preflight as a table or as JSON.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.ui.texts import calibrated_parts, calibration_lines, rig_line
from core.calibration.camera import BoardError, BoardSpec
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
    with_rig,
    write_rig,
)
from core.devices import UserError
from hardware.preflight import checks as program
from hardware.preflight.checks import RENEW, Check, one_line
from hardware.rig import RigKind, rig_config

if TYPE_CHECKING:
    from hardware.calibration.rig_draft import RigDraft


STEPS = ("board", "servos", "zero", "steering")
_BOARD_TRIES = 4


@dataclass(frozen=True, slots=True)
class CalibrateOptions:
    """``source`` names a rig to start from (twin, realsense, webcam or another rig file); ``steps`` of ``STEPS``, in that order."""

    name: str
    source: str | None
    config_path: Path | None
    steps: tuple[str, ...] = STEPS
    pictures: int = 5
    spec: BoardSpec = field(default_factory=BoardSpec)
    as_json: bool = False


def run_list(*, as_json: bool) -> None:
    """All rig files, those that cannot be used with the reason."""
    listed = list_rigs()
    if as_json:
        rows = [{"name": one.name, "path": str(one.path), "problem": one.problem or None, **_brief(one.rig)} for one in listed]
        sys.stdout.write(json.dumps({"folder": str(rigs_folder()), "built_in": list(RESERVED), "rigs": rows}) + "\n")
        return
    for one in listed:
        sys.stdout.write(f"{one.name}: {rig_line(one.rig) if one.rig is not None else one.problem}\n")
    if not listed:
        sys.stdout.write(
            f"no rig files in {rigs_folder()}; make one: main.py rig calibrate NAME --auto, or menu Rig in the window\n"
        )


def run_show(name: str, *, as_json: bool) -> None:
    """One rig with its calibration; raises RigFileError."""
    path, rig = find_rig(name)
    if as_json:
        sys.stdout.write(json.dumps({"path": str(path), **rig.model_dump(mode="json")}) + "\n")
        return
    sys.stdout.write("\n".join([f"{rig.name} ({path})", rig_line(rig), *calibration_lines(rig)]) + "\n")


def run_board(out: Path, spec: BoardSpec) -> None:
    """Write the board for the printer; raises BoardPrintError."""
    from app.rig_wizard.board_print import print_board

    paper = print_board(out, spec)
    sys.stdout.write(f"{out}\n")
    sys.stderr.write(f"print it on {paper} at 100 %, and measure the line of 100 mm on it\n")


def run_calibrate(options: CalibrateOptions) -> None:
    """Calibrate without help, and save the rig; raises UserError with what went wrong, and KeyboardInterrupt.

    Steps that were done until then are saved, as if no others had been asked for.
    """
    from app.operator.rig_engine import quick_sight
    from hardware.calibration.bench import open_bench
    from hardware.calibration.rig_draft import RigDraft

    config, earlier = _start(options)
    check_can_save(options.name)
    bench = open_bench(config, quick_sight(config))
    done: list[str] = []
    ended: UserError | KeyboardInterrupt | None = None
    try:
        draft = RigDraft(bench, config, earlier.calibration if earlier is not None else None, _say)
        draft.spec = options.spec
        bench.warm_up()
        for step in calibrate(draft, options.steps, options.pictures):
            done.append(step)
    except (UserError, KeyboardInterrupt) as error:
        if not done:
            raise
        ended = error
    finally:
        bench.close()
    if draft.zero is None and "zero" in done:  # a servo failed afterwards, and nobody knows where the wires are
        done.remove("zero")
    rig = draft.rig_file(options.name)
    path = write_rig(rig)
    if ended is not None:
        left = ",".join(step for step in STEPS if step in options.steps and step not in done)
        kept = f"{' and '.join(done)} saved in {path}; go on: rig calibrate {shlex.quote(rig.name)} --auto --steps {left}"
        if isinstance(ended, UserError):
            raise UserError(f"{ended}; {kept}")
        _say(kept)
        raise ended
    if options.as_json:
        sys.stdout.write(json.dumps({"path": str(path), "notes": draft.notes, **rig.model_dump(mode="json")}) + "\n")
        return
    sys.stdout.write("\n".join([f"{rig.name} ({path})", rig_line(rig), *calibration_lines(rig), *draft.notes]) + "\n")


def calibrate(draft: RigDraft, steps: tuple[str, ...], pictures: int) -> Iterator[str]:
    """The steps in their order, each named when what it found can be kept; each raises what the draft raises."""
    if "board" in steps:
        draft.forget_boards()
        failures: list[BoardError] = []
        while len(draft.views) < pictures:
            try:
                draft.take_board()
            except BoardError as error:
                failures.append(error)
                if len(failures) > _BOARD_TRIES:
                    raise
        draft.solve_boards()
        yield "board"
    if set(steps) & {"servos", "zero", "steering"}:
        if "board" in steps and draft.bench.kind is not RigKind.SIM:  # the twin's lies in its pictures of it only
            draft.wait_for_no_board()
        draft.search_servos()
    if "servos" in steps:
        draft.identify()
        yield "servos"
    if "zero" in steps:
        zeros = draft.find_zeros()
        if zeros.problems:  # to pull on from there would be to measure from nowhere
            raise UserError(f"no zero for all tendons: {'; '.join(zeros.problems)}")
        if draft.zero is not None:
            yield "zero"
    if "steering" in steps:
        was_kept = draft.zero is not None
        draft.learn_steering()  # it stores where the tendons were left, too
        yield from ["steering"] if was_kept or "zero" not in steps else ["zero", "steering"]


def _start(options: CalibrateOptions) -> tuple[Config, RigFile | None]:
    """The configuration to calibrate, and the rig that it comes from."""
    try:
        name = check_rig_name(options.name)
    except ValueError as error:
        raise UserError(str(error)) from None
    if not options.steps:
        raise UserError(f"--steps names no step; known: {', '.join(STEPS)}")
    if unknown := set(options.steps) - set(STEPS):
        raise UserError(f"unknown step {sorted(unknown)[0]!r}; known: {', '.join(STEPS)}")
    source = options.source
    if source is None:
        source = name if has_rig(name) else "twin"
    if source in RESERVED:
        return rig_config(source, options.config_path, None)[0], None
    path, rig = find_rig(source)
    return with_rig(rig_config(None, options.config_path, None)[0], rig, path), rig


def _brief(rig: RigFile | None) -> dict[str, Any]:
    if rig is None:
        return {"kind": None, "robot": None, "made_utc": None, "calibrated": []}
    return {"kind": rig.kind, "robot": rig.robot, "made_utc": rig.made_utc.isoformat(), "calibrated": calibrated_parts(rig)}


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")


_NAME_COLUMNS = 18


def run_doctor(rig: str | None, config_path: Path | None, *, as_json: bool) -> int:
    """Check everything and tell; returns 0 when all is well, 1 when something is not. Raises UserError for bad input."""
    checks = list(_with_progress(_checks(rig, config_path)))
    if as_json:
        sys.stdout.write(json.dumps({"checks": [check.to_json() for check in checks]}) + "\n")
    else:
        _print(checks)
    return 0 if all(check.ok for check in checks) else 1


def _checks(rig: str | None, config_path: Path | None) -> Iterator[Check]:
    """All of them; where what they stand on is missing or damaged, those that say so."""
    # One that is cut short would end this process, too.
    problem = program.load_problem(program.OPENCV)
    if problem:
        problem = f"{program.OPENCV}: {problem}"
    else:
        try:
            from hardware.preflight.preflight import run_checks
        except ImportError as error:
            problem = one_line(error)
    if problem:
        yield from (check() for check in program.OF_THE_PROGRAM)
        yield Check("all others", False, f"not made, since the program does not load: {problem}", RENEW)
        return
    config, _ = rig_config(rig, config_path, None)
    yield from run_checks(config)


def _with_progress(checks: Iterator[Check]) -> Iterator[Check]:
    """The slowest take seconds: say on standard error that something happens."""
    with Console(stderr=True, emoji=False).status("checking ...") as status:
        for check in checks:
            status.update(Text(f"checking ... {check.name}: {'ok' if check.ok else 'not ok'}"))
            yield check


def _print(checks: list[Check]) -> None:
    console = Console(highlight=False, markup=False, emoji=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, expand=False)
    table.add_column("", no_wrap=True)
    table.add_column("check", no_wrap=True, min_width=_NAME_COLUMNS)
    table.add_column("found", overflow="fold")
    for check in checks:
        # A word beside the colour: colour alone says nothing to some, and to a file.
        mark = Text("ok", style="green") if check.ok else Text("NOT OK", style="bold red")
        table.add_row(mark, Text(check.name), Text(check.detail))
    console.print(table)
    wrong = [check for check in checks if not check.ok]
    if not wrong:
        sys.stdout.write("All is well.\n")
        return
    sys.stdout.write("What to do:\n")
    for check in wrong:
        # Not through the console: a command must stay on one line, so that it can be copied.
        sys.stdout.write(f"  {check.name}: {check.fix}\n")

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

from app.operator.startup import window_config
from app.ui.i18n import mark, tr, tr_text
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
from hardware.rig import RigKind

if TYPE_CHECKING:
    from hardware.calibration.bench import See
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
        sys.stdout.write(f"{one.name}: {describe(one.rig) if one.rig is not None else one.problem}\n")
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
    sys.stdout.write("\n".join([f"{rig.name} ({path})", describe(rig), *calibration_lines(rig)]) + "\n")


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
    sys.stdout.write("\n".join([f"{rig.name} ({path})", describe(rig), *calibration_lines(rig), *draft.notes]) + "\n")


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


def quick_sight(config: Config) -> See:
    """Perception of single frames as the calibration wants it: quickly, with a core left for servos and camera."""
    from app.operator.rig_engine import leaving_a_core
    from core.perception.pipeline import open_pipeline

    perception = leaving_a_core(config.perception)
    plain = perception.segmentation.model_copy(update={"mirrored": "never"})
    return open_pipeline(perception.model_copy(update={"segmentation": plain})).perceive_single


def describe(rig: RigFile) -> str:
    """One line for people."""
    camera = {
        "twin": tr("bench twin"),
        "realsense": f"RealSense {rig.camera.serial or ''}",
        "webcam": tr("webcam {device}", device=rig.camera.device or ""),
    }
    servos = {"twin": tr("its own servos"), "servos": tr("servos on {port}", port=rig.servos.port), "none": tr("no servos")}
    return tr(
        "{camera}, {servos}; {calibrated}; made {made:%Y-%m-%d}",
        camera=camera[rig.kind].strip(),
        servos=servos[rig.robot],
        calibrated=_calibrated(rig),
        made=rig.made_utc,
    )


def calibration_lines(rig: RigFile) -> list[str]:
    """What was calibrated, a line each."""
    known = rig.calibration
    if known is None:
        return [tr("not calibrated")]
    lines = []
    if known.lens is not None:
        lines.append(
            tr(
                "lens: k1 {k1:+.4f}, k2 {k2:+.4f}, {left:.2f} px left over",
                k1=known.lens.k1,
                k2=known.lens.k2,
                left=known.lens.residual_px,
            )
        )
    if known.scale is not None:
        scale = known.scale
        share = 100 * scale.uncertainty_share
        text = tr(
            "scale: {scale:.4f} mm/px in the middle, \N{PLUS-MINUS SIGN}{share:.2f} % (by {method})",
            scale=scale.mm_per_px,
            share=share,
            method=tr_text(scale.method),
        )
        lines.append(text)
    servos = ", ".join(f"{tr_text(joint.name)} {'+' if joint.sign > 0 else '-'}{joint.id}" for joint in rig.servos.joints)
    lines.append(tr("servos (direction and id): {servos}", servos=servos))
    ways = ", ".join(f"{tr_text(joint.name)} {joint.mm_per_turn:g}" for joint in rig.servos.joints)
    lines.append(tr("way at one turn of the horn, as it is set and not measured: {ways} mm", ways=ways))
    if known.assumed:
        lines.append(
            tr(
                "assumed: {joints} by the order of their ids, since one camera cannot tell them apart; look at the head, and swap "
                "them in the rig wizard if it goes the other way",
                joints=tr(" and ").join(tr_text(name) for name in known.assumed),
            )
        )
    if known.steering is not None:
        ways = ", ".join(
            f"{tr_text(tendon.name)} {tr('out of the picture') if tendon.direction_deg is None else f'{tendon.direction_deg:.0f}°'}"
            for tendon in known.steering.tendons
        )
        lines.append(
            tr(
                "steering, 0° to the right and 90° down in the picture: {ways}; roll {roll:+.0f}°",
                ways=ways,
                roll=known.steering.roll_deg,
            )
        )
    if known.zero is not None:
        slack = ", ".join(f"{value:+.2f}" for value in known.zero.slack_mm)
        lines.append(
            tr(
                "zero: wires were slack by {slack} mm; pretension {pretension:g} mm",
                slack=slack,
                pretension=known.zero.pretension_mm,
            )
        )
    return lines


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
        return window_config(source, options.config_path, None)[0], None
    path, rig = find_rig(source)
    return with_rig(window_config(None, options.config_path, None)[0], rig, path), rig


_PARTS = (mark("lens"), mark("scale"), mark("steering"), mark("zero"))


def _brief(rig: RigFile | None) -> dict[str, Any]:
    if rig is None:
        return {"kind": None, "robot": None, "made_utc": None, "calibrated": []}
    known = rig.calibration
    done = [part for part in _PARTS if known is not None and getattr(known, part) is not None]
    return {"kind": rig.kind, "robot": rig.robot, "made_utc": rig.made_utc.isoformat(), "calibrated": done}


def _calibrated(rig: RigFile) -> str:
    parts = _brief(rig)["calibrated"]
    return tr("calibrated: {parts}", parts=", ".join(tr(part) for part in parts)) if parts else tr("not calibrated")


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
            from app.operator.startup import window_config
            from hardware.preflight.preflight import run_checks
        except ImportError as error:
            problem = one_line(error)
    if problem:
        yield from (check() for check in program.OF_THE_PROGRAM)
        yield Check("all others", False, f"not made, since the program does not load: {problem}", RENEW)
        return
    config, _ = window_config(rig, config_path, None)
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

"""``rig accept``: the acceptance of a rig with real servos, step by step. What was done is kept, and goes on there."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.options import ConfigOption, JsonOption
from core.config.acceptance import (
    ESTOP_STEP,
    STOP_TRIES,
    Acceptance,
    AcceptanceError,
    ForceReading,
    acceptance_path,
    changes_since,
    force_problem,
    new_acceptance,
    problems_of,
    read_acceptance,
    write_acceptance,
)
from core.config.files import own_settings_path, read_settings
from core.config.models import Config
from core.config.rig_file import RigFile, find_rig, with_rig
from core.config.safety import TENDONS, JointConfig, JointKind
from core.devices import UserError
from core.program import CALLED

if TYPE_CHECKING:
    from hardware.calibration.acceptance import AcceptanceBench

_ESTOP_WITHIN_S = 120.0
"""So long the press, and then the release, of the E-stop are waited for."""


def accept_rig(
    name: Annotated[str, typer.Argument(metavar="NAME", help="of the rig")],
    operator: Annotated[str | None, typer.Option(help="name of who accepts; asked for when it is left out")] = None,
    force: Annotated[list[str] | None, typer.Option(metavar="AXIS=N", help="newtons read at an axis; asked for otherwise")] = None,
    scale: Annotated[bool, typer.Option("--pull/--no-pull", help="no: the forces of --force were read before")] = True,
    anew: Annotated[bool, typer.Option("--anew", help="begin again; the acceptance before is kept beside it")] = False,
    show: Annotated[bool, typer.Option("--show", help="only say what is recorded and missing")] = False,
    as_json: JsonOption = False,
    config_path: ConfigOption = None,
) -> None:
    """Accept a rig with real servos: directions, forces at a scale, stop times, E-stop; without it the program only advises."""
    path, rig = find_rig(name)
    config = config_of(path, rig, config_path)
    if show:
        print_acceptance(path, config, as_json=as_json)
        return
    if rig.robot != "servos":
        raise UserError(f"rig {rig.name} has no servos of its own: there is nothing to accept")
    if rig.servos.driver != "dynamixel" or not any(joint.kind is JointKind.ADVANCE for joint in rig.servos.joints):
        raise UserError(
            f"rig {rig.name} has another drive than DYNAMIXEL servos, or no feed: it cannot be accepted, and stays advisory"
        )
    readings = _readings(force or [], rig.servos.names)
    accepted = _begin(path, rig, config, operator, anew=anew)
    _say(f"Ctrl-C stops the servos at any moment and keeps what was done; the E-stop is within reach of {accepted.operator}")
    try:
        for done in _steps(config, accepted, readings, pulls=scale):
            accepted = done
            write_acceptance(path, accepted)
    except (UserError, KeyboardInterrupt) as error:
        kept = f"what was done is kept in {acceptance_path(path)}; go on: {CALLED} rig accept {shlex.quote(name)}"
        if isinstance(error, UserError):
            raise UserError(f"{error}; {kept}") from None
        _say(kept)
        raise
    if accepted.finished_utc is None:
        accepted = accepted.model_copy(update={"finished_utc": datetime.now(UTC).replace(microsecond=0)})
        write_acceptance(path, accepted)
    print_acceptance(path, config, as_json=as_json)


def config_of(path: Path, rig: RigFile, config_path: Path | None = None) -> Config:
    """The configuration with which the window drives a rig: its own settings decide about STOP and deadman, too."""
    return with_rig(read_settings(config_path or own_settings_path(), may_move=False).config, rig, path)


def _begin(path: Path, rig: RigFile, config: Config, operator: str | None, *, anew: bool) -> Acceptance:
    """The acceptance to go on with, or a new one if it is missing or something has changed since."""
    before = None if anew else read_acceptance(path)
    if before is not None:
        changed = changes_since(before, config)
        if not changed and (operator is None or operator == before.operator):
            return before
        why = "; ".join(changed) if changed else f"it was begun by {before.operator}"
        _say(f"the acceptance begins again ({why})")
    operator = operator or _ask("your name: ")
    if not operator:
        raise UserError("an acceptance needs the name of who makes it: --operator NAME")
    accepted = new_acceptance(operator, config, rig.camera.serial or rig.camera.device or "")
    write_acceptance(path, accepted, keeps_older=True)
    return accepted


def _steps(config: Config, accepted: Acceptance, readings: dict[str, float], *, pulls: bool) -> Any:
    """The steps that are missing, each with the acceptance after it. Raises UserError, KeyboardInterrupt."""
    from hardware.calibration.acceptance import AcceptanceBench
    from hardware.calibration.servo_probe import StopSwitch
    from hardware.servos.eeprom import backups_folder

    bench = AcceptanceBench(config, StopSwitch(), backups_folder())
    servos, supply_v = bench.identify()
    if accepted.servos and changes_since(accepted, config, [servo.firmware for servo in servos]):
        raise UserError("the servos' firmware has changed since this acceptance was begun: begin again with --anew")
    accepted = accepted.model_copy(update={"servos": servos, "supply_v": supply_v})
    _say(f"servos: {len(servos)} answer, {supply_v[0]:.1f} to {supply_v[1]:.1f} V")
    yield accepted
    joints = {joint.name: joint for joint in config.servos.joints}
    for name, joint in joints.items():
        if name not in accepted.directions:
            _confirm_direction(bench, joint)
            accepted = accepted.model_copy(update={"directions": (*accepted.directions, name)})
            yield accepted
    for name, joint in joints.items():
        if name not in {reading.name for reading in accepted.forces}:
            reading = _read_force(bench, joint, readings.get(name), pulls=pulls)
            accepted = accepted.model_copy(update={"forces": (*accepted.forces, reading)})
            yield accepted
    for kind, what in (("STOP", "STOP"), ("deadman", "a deadman that falls silent")):
        if kind not in {one.kind for one in accepted.stops}:
            free = "free 15 mm before and behind the robot"
            _wait(f"{kind} times: {free}; Enter drives the feed and ends it by {what}, {STOP_TRIES} times")
            feed = next(joint for joint in joints.values() if joint.kind is JointKind.ADVANCE)
            accepted = accepted.model_copy(update={"stops": (*accepted.stops, bench.stop_times(kind, feed, _say))})
            yield accepted
    if accepted.estop is None:
        _wait(f"{ESTOP_STEP}: slacken the wires; Enter switches the servos on, then press the E-stop when it says so")
        yield accepted.model_copy(update={"estop": bench.estop(_say, _ESTOP_WITHIN_S)})


def _confirm_direction(bench: AcceptanceBench, joint: JointConfig) -> None:
    from hardware.calibration.acceptance import DIRECTION_MM

    _wait(f"direction of {joint.name}: look at the robot; Enter moves it by {DIRECTION_MM[joint.kind]:g} {joint.unit} and back")
    bench.show_direction(joint)
    if not _ask(f"  {_seen(joint)}? y or n: ").lower().startswith("y"):
        raise AcceptanceError(
            f"direction of {joint.name} is wrong: menu Rig, Calibrate (page Wiggle and direction), or its id and sign"
        )


def _seen(joint: JointConfig) -> str:
    """What is seen of a joint that is moved in its positive direction, as a question."""
    if joint.kind is JointKind.ROTATION:
        return "did the shaft turn to the left, seen from behind (from the robot's right towards the camera)"
    if not joint.is_tendon:
        return "did it go forward"
    to = f"to the robot's {joint.name}" if joint.name in TENDONS else f"at {joint.angle_deg:g}° (0: its right, 90: the camera)"
    return f"did its wire tighten, and bend the head {to}"


def _read_force(bench: AcceptanceBench, joint: JointConfig, given_n: float | None, *, pulls: bool) -> ForceReading:
    by_current_n = None
    if pulls:
        scale = "a spring scale or load cell that keeps its peak"
        lever = " by a lever on the shaft" if joint.kind is JointKind.ROTATION else ""
        _wait(f"force of {joint.name}: tie it to {scale}{lever}; Enter pulls with {joint.max_force_n:g} {joint.force_unit}")
        pull = bench.pull(joint)
        if not pull.was_held:
            raise AcceptanceError(f"nothing held {joint.name}: fasten the scale so that it is taut, then try again")
        by_current_n = pull.by_current_n
    what = "newtons on the scale times the lever's mm" if joint.kind is JointKind.ROTATION else "newtons on the scale"
    read_n = given_n if given_n is not None else _number(_ask(f"  highest {what}: "))
    if problem := force_problem(joint.name, read_n, joint.max_force_n, joint.force_unit):
        raise AcceptanceError(problem)
    return ForceReading(name=joint.name, limit_n=joint.max_force_n, read_n=read_n, by_current_n=by_current_n)


def acceptance_lines(accepted: Acceptance | None, config: Config) -> list[str]:
    """What is recorded, and what it no longer holds for, a line each."""
    problems = problems_of(accepted, config)
    if accepted is None:
        return [f"acceptance: none; {CALLED} rig accept NAME"]
    state = f"NOT valid: {'; '.join(problems)}" if problems else "valid"
    made = accepted.finished_utc or accepted.begun_utc
    version = f"version {accepted.version}" + (f" ({accepted.commit})" if accepted.commit else "")
    lines = [f"acceptance by {accepted.operator}, {made:%Y-%m-%d}, {version}: {state}"]
    if accepted.servos:
        told = ", ".join(f"{one.name} id {one.id} model {one.model} firmware {one.firmware}" for one in accepted.servos)
        lines.append(f"accepted servos: {told}")
    if accepted.forces:
        units = {joint.name: joint.force_unit for joint in config.servos.joints}
        read = ", ".join(f"{one.name} {one.read_n:g} of {one.limit_n:g} {units.get(one.name, 'N')}" for one in accepted.forces)
        lines.append(f"accepted forces: {read}")
    lines += [f"{one.kind} to stand-still: {max(one.times_ms):.0f} ms, {one.way_mm:g} mm at most" for one in accepted.stops]
    if accepted.estop is not None:
        lines.append(f"{ESTOP_STEP}: disarmed after {accepted.estop.silent_ms:.0f} ms ({accepted.estop.cause})")
    return lines


def print_acceptance(path: Path, config: Config, *, as_json: bool) -> None:
    """The acceptance of a rig file. Raises AcceptanceError."""
    accepted = read_acceptance(path)
    if not as_json:
        sys.stdout.write("\n".join(acceptance_lines(accepted, config)) + "\n")
        return
    problems = problems_of(accepted, config)
    record = None if accepted is None else accepted.model_dump(mode="json")
    result = {"path": str(acceptance_path(path)), "valid": not problems, "problems": problems, "acceptance": record}
    sys.stdout.write(json.dumps(result) + "\n")


def _readings(texts: list[str], names: Sequence[str]) -> dict[str, float]:
    """Axis and newtons (N mm of a rotation) of each --force. Raises UserError."""
    found: dict[str, float] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in names or not value:
            raise UserError(f"--force {text}: say AXIS=NEWTONS; axes: {', '.join(names)}")
        found[name] = _number(value)
    return found


def _number(text: str) -> float:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = -1.0
    if not 0.0 < value < 10_000.0:
        raise UserError(f"{text!r} is no force in newtons")
    return value


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _ask(question: str) -> str:
    """An answer from standard input. Raises UserError at its end."""
    sys.stderr.write(question)
    sys.stderr.flush()
    if not (line := sys.stdin.readline()):
        raise UserError("no answer on standard input: run it in a terminal")
    return line.strip()


_wait: Callable[[str], str] = _ask
"""Wait for Enter."""

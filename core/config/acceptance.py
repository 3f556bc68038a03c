"""The acceptance of a rig with real servos: what was checked, when and by whom, and whether it still holds. Pure but for its file.

It lies beside the rig file as NAME.acceptance.json. It holds for the rig, adapter, servos, directions, envelopes, speeds, steps,
force limits, pull, STOP behaviour and major version of the program that it was made with (``Basis``): when one of them changes, the
rig is advisory until it is accepted again.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from core.config.models import Config
from core.config.safety import JOINT_NAMES, JointName, wiring_of
from core.config.section import ConfigSection, first_problem
from core.devices import UserError, disk_errors
from core.files import write_atomic
from core.program import as_called, program_commit, program_version

FORMAT = 1
FORCE_ALLOWANCE = 1.1
"""A force that is read may be so many times the configured one."""
STOP_TRIES = 3
"""Stops that are timed of each kind."""
MOST_STOP_MS = 500.0
"""A longer way to stand-still is no stop: the rules end every motion after 500 ms."""
ESTOP_STEP = "E-stop"
_OF_BEFORE = "it does not say with which envelopes, speeds and pull it was made: main.py rig accept NAME"
_ENDING, _OLDER = ".acceptance.json", ".acceptance.older.json"
_MAX_BYTES = 200_000


class AcceptanceError(UserError):
    """An acceptance cannot be read or saved, or a step of it failed; one line says what to do."""


class StopBehaviour(ConfigSection):
    """What decides how the rig stops."""

    torque_off_on_stop: bool
    watchdog_s: float
    heartbeat_timeout_s: float
    command_max_age_s: float
    deadman_timeout_s: float


_LIMITS = ("low_mm", "high_mm", "max_speed_mm_s", "max_acceleration_mm_s2", "max_step_mm")
"""Settings of each joint that an acceptance holds for."""
_PULL = ("pretension_mm", "pretension_mm_s", "max_pull_mm")
"""And those of all tendons."""


class Basis(ConfigSection):
    """What an acceptance holds for; tuples are per joint, in their order."""

    joints: tuple[JointName, ...] = JOINT_NAMES
    wiring: tuple[tuple[int, int], ...] = Field(description="id and sign")
    models: tuple[int, ...]
    mm_per_turn: tuple[float, ...]
    max_force_n: tuple[float, ...]
    limits: dict[str, tuple[float, ...]] = Field({}, description="by setting; older records have none")
    pull: dict[str, float] = Field({}, description="by setting; older records have none")
    stop: StopBehaviour
    major: str = Field(description="major version of the program")


class AcceptedServo(ConfigSection):
    """A servo as it answered. X series servos have no serial number: model, firmware and id are their identity."""

    name: JointName
    id: int
    model: int
    firmware: int


class ForceReading(ConfigSection):
    """The force of an axis that the operator read from a scale, and what the servo's own current says (None: it reports none)."""

    name: JointName
    limit_n: float = Field(gt=0.0)
    read_n: float = Field(gt=0.0)
    by_current_n: float | None = None

    @model_validator(mode="after")
    def _check_force(self) -> Self:
        if problem := force_problem(self.name, self.read_n, self.limit_n):
            raise ValueError(problem)
        return self


class StopTimes(ConfigSection):
    """Milliseconds from the event to stand-still, as the servo's own positions show it; resolution: a cycle of the bus."""

    kind: Literal["STOP", "deadman"]
    joint: JointName
    speed_mm_s: float
    times_ms: tuple[float, ...] = Field(min_length=STOP_TRIES)
    way_mm: float = Field(description="longest way after the event")

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        if max(self.times_ms) > MOST_STOP_MS:
            raise ValueError(f"{self.kind}: {max(self.times_ms):.0f} ms to stand-still, at most {MOST_STOP_MS:.0f} ms")
        return self


class EstopRecord(ConfigSection):
    """The E-stop was pressed and released."""

    cause: str = Field(description="the program's cause for disarming")
    silent_ms: float = Field(description="from the last whole answer of the servos to disarmed")
    refused: str = Field(description="why arming was refused while it was pressed")
    refused_after: str = Field(description="and when power was back, before the joints were zeroed")


class Acceptance(ConfigSection):
    """An acceptance, complete or not yet (``missing``)."""

    format: int = Field(FORMAT, ge=1)
    rig: str
    operator: str = Field(min_length=1, max_length=100)
    begun_utc: datetime
    finished_utc: datetime | None = None
    version: str
    commit: str | None = None
    basis: Basis
    adapter: str = Field("", description="path of the servo port, which holds the adapter's serial number")
    camera: str = Field("", description="serial number or stable path")
    servos: tuple[AcceptedServo, ...] = ()
    supply_v: tuple[float, float] | None = Field(None, description="lowest and highest that the servos told")
    directions: tuple[JointName, ...] = Field((), description="confirmed by eye")
    forces: tuple[ForceReading, ...] = ()
    stops: tuple[StopTimes, ...] = ()
    estop: EstopRecord | None = None

    @property
    def missing(self) -> tuple[str, ...]:
        """The steps that are not done, in their order."""
        read = {reading.name for reading in self.forces}
        found = [] if len(self.servos) == len(self.basis.joints) and self.supply_v is not None else ["servos"]
        found += [f"direction of {name}" for name in self.basis.joints if name not in self.directions]
        found += [f"force of {name}" for name in self.basis.joints if name not in read]
        found += [f"{kind} times" for kind in ("STOP", "deadman") if kind not in {one.kind for one in self.stops}]
        return (*found, *([] if self.estop is not None else [ESTOP_STEP]))


def force_problem(name: str, read_n: float, limit_n: float, unit: str = "N") -> str:
    """Why a force that was read is refused; "" when it is not."""
    most_n = FORCE_ALLOWANCE * limit_n
    if read_n <= most_n:
        return ""
    return (
        f"{name} pulled {read_n:g} {unit}, at most {most_n:g} {unit} ({limit_n:g} {unit} and 10 %): correct its way per turn, or "
        "lower its greatest force, then try again"
    )


def basis_of(config: Config, version: str) -> Basis:
    """What an acceptance of this configuration would hold for."""
    servos, safety = config.servos, config.safety
    return Basis(
        joints=servos.names,
        wiring=wiring_of(servos),
        models=tuple(servos.model_of(joint).number for joint in servos.joints),
        mm_per_turn=tuple(joint.mm_per_turn for joint in servos.joints),
        max_force_n=tuple(joint.max_force_n for joint in servos.joints),
        limits={key: tuple(getattr(joint, key) for joint in servos.joints) for key in _LIMITS},
        pull={key: getattr(servos, key) for key in _PULL},
        stop=StopBehaviour(
            torque_off_on_stop=servos.torque_off_on_stop,
            watchdog_s=servos.watchdog_s,
            heartbeat_timeout_s=servos.heartbeat_timeout_s,
            command_max_age_s=safety.command_max_age_s,
            deadman_timeout_s=safety.deadman_timeout_s,
        ),
        major=version.partition(".")[0],
    )


def changes_since(accepted: Acceptance, config: Config, firmware: Sequence[int] = ()) -> tuple[str, ...]:
    """What an acceptance no longer holds for as the rig is configured, each in a few words.

    `firmware` is that of the servos, in the order of the joints; empty: they were not asked.
    """
    then, now = accepted.basis, basis_of(config, program_version())
    if then.joints != now.joints:
        return (f"the joints were {', '.join(then.joints)} and are {', '.join(now.joints)}",)
    found = [] if then.limits and then.pull else [_OF_BEFORE]
    for what, was, name in (("rig", accepted.rig, config.rig.name), ("adapter", accepted.adapter, config.servos.port or "")):
        if was != name:
            found.append(f"{what} was {was} and is {name}")
    columns: tuple[tuple[str, Sequence[Any], Sequence[Any]], ...] = (
        ("id", [one[0] for one in then.wiring], [one[0] for one in now.wiring]),
        ("sign", [one[1] for one in then.wiring], [one[1] for one in now.wiring]),
        ("model", then.models, now.models),
        ("mm_per_turn", then.mm_per_turn, now.mm_per_turn),
        ("max_force_n", then.max_force_n, now.max_force_n),
        *((key, then.limits.get(key, ()), now.limits[key]) for key in _LIMITS),
        ("firmware", [servo.firmware for servo in accepted.servos], firmware),
    )
    for what, before, after in columns:
        for name, old, new in zip(now.joints, before, after, strict=False):
            if old != new:
                found.append(f"{what} of {name} was {old:g} and is {new:g}")
    for key in _PULL:
        if key in then.pull and then.pull[key] != now.pull[key]:
            found.append(f"{key} was {then.pull[key]:g} and is {now.pull[key]:g}")
    for key, old in then.stop:
        if (new := getattr(now.stop, key)) != old:
            found.append(f"{key} was {old} and is {new}")
    if then.major != now.major:
        found.append(f"version of the program was {accepted.version}")
    return tuple(found)


def is_outdated(accepted: Acceptance, config: Config, firmware: Sequence[int] = ()) -> bool:
    """Whether something has changed since."""
    return bool(changes_since(accepted, config, firmware))


def problems_of(accepted: Acceptance | None, config: Config, firmware: Sequence[int] = ()) -> tuple[str, ...]:
    """Why a rig of this configuration is not accepted; empty when it is."""
    if accepted is None:
        return ("no acceptance is recorded",)
    if changed := changes_since(accepted, config, firmware):
        return changed
    return tuple(f"not done: {step}" for step in accepted.missing)


def acceptance_path(rig_file: Path) -> Path:
    """Where the acceptance of a rig file lies."""
    return rig_file.with_name(rig_file.stem + _ENDING)


def read_acceptance(rig_file: Path) -> Acceptance | None:
    """The acceptance of a rig file; None without one. Raises AcceptanceError; the file is never changed."""
    path = acceptance_path(rig_file)
    again = as_called("accept the rig again (main.py rig accept NAME --anew)")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise AcceptanceError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > _MAX_BYTES:
        raise AcceptanceError(f"{path}: too large for an acceptance: {again}")
    try:
        found = Acceptance.model_validate_json(data)
    except ValidationError as error:
        raise AcceptanceError(f"{path}: {first_problem(error)}; the file is kept: {again}") from None
    if found.format > FORMAT:
        raise AcceptanceError(f"{path}: format {found.format} is of a newer version: update the program, or {again}")
    return found


def write_acceptance(rig_file: Path, accepted: Acceptance, *, keeps_older: bool = False) -> Path:
    """Save it atomically; with `keeps_older` the one before stays as NAME.acceptance.older.json. Raises AcceptanceError."""
    path = acceptance_path(rig_file)
    older = rig_file.with_name(rig_file.stem + _OLDER) if keeps_older else None
    with disk_errors(AcceptanceError, path, "cannot be saved"):
        write_atomic(path, (accepted.model_dump_json(indent=1) + "\n").encode(), durable=True, older=older)
    return path


def new_acceptance(operator: str, config: Config, camera: str) -> Acceptance:
    """An acceptance that begins."""
    version = program_version()
    return Acceptance(
        rig=config.rig.name,
        operator=operator,
        begun_utc=datetime.now(UTC).replace(microsecond=0),
        version=version,
        commit=program_commit(),
        basis=basis_of(config, version),
        adapter=config.servos.port or "",
        camera=camera,
    )

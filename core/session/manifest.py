"""``manifest.json``, which says what a session is, its description, and the events of ``events.jsonl``.

The manifest is written when the session begins and when it ends, each time atomically. Its description is that of the beginning;
what is changed later, and the tags, stand beside it in ``description.json``, so that no file of the recorder is written again.
"""

from __future__ import annotations

import contextlib
import json
import platform
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import platformdirs
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from core.bench.bench import BenchError, bench_sha256, read_bench
from core.config.calibration import CalibrationConfig
from core.config.models import Config
from core.config.rig_file import RigFileError, calibration_of
from core.config.section import first_problem
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.control.gate import Source
from core.control.modes import ARMED_MODES, DRIVING_MODES, Mode
from core.devices import UserError, disk_errors
from core.files import write_atomic
from core.perception.model_file import ModelError, model_folder, read_model_info
from core.program import known_program_id, program_id
from core.session.codec import JsonLayout, Moment, Text, finite, finite_tree, read_json
from core.types import Point

MANIFEST, DESCRIPTION, FRAMES, EVENTS = "manifest.json", "description.json", "frames.jsonl", "events.jsonl"
PREFIX, RECOVERED = "session_", "_recovered"
FORMAT = 1
_MAX_BYTES = 8_000_000
_PACKAGES = ("av", "mujoco-core", "numba", "numpy", "opencv-python-headless", "openvino", "scipy", "torch")

Kind = Literal["SIM", "LIVE", "PLAYBACK", "UNKNOWN"]
"""The banner's word; UNKNOWN only in a copy that was recovered without its manifest."""
Origin = Literal["recorded", "last seconds"]


class SessionError(UserError):
    """A session cannot be written, read, recovered or exported; the message is one line that says what to do."""


class NewerVersion(SessionError):
    """The session was written by a newer version of the program."""


_MOST_LETTERS, _MOST_TAGS = 4000, 50


def _kept_text(text: object) -> object:
    """A text as a file can hold it; a value of another type is left to the validation, None is no text."""
    if not isinstance(text, str):
        return "" if text is None else text
    return text.encode("utf-8", errors="replace").decode("utf-8").strip()[:_MOST_LETTERS]


def _kept_line(text: object) -> object:
    return " ".join(kept.split()) if isinstance(kept := _kept_text(text), str) else kept


def _kept_tags(tags: object) -> object:
    """Tags as given, or separated by commas, each once."""
    parts = tags.split(",") if isinstance(tags, str) else tags
    if not isinstance(parts, list | tuple):
        return parts
    lines = [line.replace(",", " ").lstrip("#") if isinstance(line := _kept_line(part), str) else line for part in parts]
    return tuple({str(line).casefold(): line for line in lines if line != ""}.values())[:_MOST_TAGS]


Line = Annotated[str, BeforeValidator(_kept_line)]
"""One line of text; too much of it is cut off."""


class Description(BaseModel):
    """What a session is about, in the operator's words. ``phantom`` is what lay before the camera."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    operator: Line = ""
    task: Line = ""
    condition: Line = ""
    phantom: Line = ""
    notes: Annotated[str, BeforeValidator(_kept_text)] = ""
    tags: Annotated[tuple[str, ...], BeforeValidator(_kept_tags)] = ()

    @property
    def line(self) -> str:
        """All but notes and tags, in one line; "" where nothing is known."""
        return " \N{MIDDLE DOT} ".join(part for part in (self.operator, self.task, self.condition, self.phantom) if part)

    @property
    def for_next(self) -> Description:
        """What the next recordings get, too: notes and tags are of one session."""
        return self.model_copy(update={"notes": "", "tags": ()})


def changed_description(before: Description, given: Mapping[str, object]) -> Description:
    """A description with the values that are given; None: as before."""
    return Description.model_validate(before.model_dump() | {key: value for key, value in given.items() if value is not None})


@dataclass(frozen=True, slots=True)
class About:
    """Where the pictures come from. ``calibration`` is the rig's (None: not calibrated), ``bench`` its bench's name and hash.

    ``phantom`` is what the rig itself knows of it: the twin's, or the bench's name.
    """

    kind: Kind
    rig: str
    config: dict[str, Any] = field(default_factory=dict)
    model: dict[str, str | None] = field(default_factory=dict)
    calibration: dict[str, Any] | None = None
    bench: dict[str, str] | None = None
    phantom: str = ""
    description: Description = field(default_factory=Description)


class Counts(BaseModel):
    """What was written, and what was not."""

    model_config = ConfigDict(extra="ignore")

    frames: int = Field(0, ge=0)
    events: int = Field(0, ge=0)
    videos: int = Field(0, ge=0)
    dropped: int = Field(0, ge=0, description="frames that the recorder could not take")
    bytes: int = Field(0, ge=0)


class Loss(BaseModel):
    """What a recovered copy lacks. ``origin`` is the folder of the damaged original."""

    model_config = ConfigDict(extra="ignore")

    origin: str
    recovered_utc: str
    seconds: float = Field(ge=0, allow_inf_nan=False)
    rows: int = Field(ge=0)
    pictures: int = Field(ge=0)
    problems: tuple[str, ...] = ()


class Manifest(BaseModel):
    """A session. ``started_utc`` and ``started_monotonic_s`` are one moment; rows and events count by the latter's clock.

    ``closed`` is True only when the session ended properly; ``ended`` then says why. ``description`` is that of the beginning: see
    ``read_description``.
    """

    model_config = ConfigDict(extra="ignore")

    format: int = Field(FORMAT, ge=1)
    id: str = Field(max_length=64)
    kind: Kind
    rig: str = ""
    origin: Origin = "recorded"
    started_utc: datetime
    started_monotonic_s: float = Field(allow_inf_nan=False)
    codec: str = ""
    model: dict[str, str | None] = {}
    versions: dict[str, str] = {}
    calibration: dict[str, Any] | None = None
    bench: dict[str, str] | None = None
    description: Description = Description()
    config: dict[str, Any] = {}
    closed: bool = False
    ended_utc: datetime | None = None
    ended: str = ""
    counts: Counts = Counts()
    recovered: Loss | None = None

    @property
    def known(self) -> CalibrationConfig | None:
        """The rig's calibration; None when it had none, or none that this version understands."""
        with contextlib.suppress(ValidationError):
            return CalibrationConfig.model_validate(self.calibration) if self.calibration is not None else None
        return None

    @property
    def program(self) -> str:
        """Version and commit of the program that recorded it; "" where an earlier version did not say."""
        version, commit = self.versions.get("lumenpilot", ""), self.versions.get("commit", "")
        return f"{version} ({commit})" if version and commit else version


def about_rig(config: Config, kind: Kind, rig: str) -> About:
    """What is known of a rig from its configuration and its file; a model that cannot be read has no hashes."""
    name = config.perception.segmentation.model
    model: dict[str, str | None] = {"name": name}
    try:
        info = read_model_info(model_folder(name), verify=())
    except ModelError as error:
        model["problem"] = str(error)
    else:
        model["sha256"] = info.weights_sha256
        model["onnx_sha256"], model["onnx_int8_sha256"] = info.onnx_sha256, info.onnx_int8_sha256
        model["second_look_sha256"] = info.second_look_sha256
    known = None
    with contextlib.suppress(RigFileError):  # reported when the rig is opened
        known = calibration_of(config)
    calibration = known.model_dump(mode="json", exclude={"view"}) if known is not None else None
    bench = _about_bench(config.perception.bench)
    phantom = config.twin.phantom if kind == "SIM" else (bench or {}).get("name", "")
    return About(kind, rig, config.model_dump(mode="json"), model, calibration, bench, phantom)


def _about_bench(folder: str | None) -> dict[str, str] | None:
    """Name and hash of the bench in a folder, or what is wrong with it; None without one."""
    if folder is None:
        return None
    try:
        return {"name": read_bench(Path(folder)).name, "sha256": bench_sha256(Path(folder))}
    except BenchError as error:
        return {"problem": str(error)}


def program_versions(program: Mapping[str, str]) -> dict[str, str]:
    """Version and commit as they stand among the versions of a session."""
    return {{"version": "lumenpilot"}.get(key, key): value for key, value in program.items()}


def package_versions(*, waits: bool = True) -> dict[str, str]:
    """Versions of all that decides what is seen and written; without `waits` not the commit where git has not answered yet."""
    versions = program_versions(program_id() if waits else known_program_id())
    versions |= {"python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}
    for name in _PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def new_manifest(about: About, session_id: str, started: datetime, monotonic_s: float, codec: str) -> Manifest:
    """The manifest of a session that begins. The twin knows its phantom; elsewhere the operator knows better."""
    given = about.description.phantom
    phantom = about.phantom or given if about.kind == "SIM" else given or about.phantom
    return Manifest(
        id=session_id,
        kind=about.kind,
        rig=about.rig,
        started_utc=started.astimezone(UTC),
        started_monotonic_s=monotonic_s,
        codec=codec,
        model=about.model,
        versions=package_versions(waits=False),
        calibration=about.calibration,
        bench=about.bench,
        description=about.description.model_copy(update={"phantom": phantom}),
        config=about.config,
    )


def write_manifest(folder: Path, manifest: Manifest) -> int:
    """Write it atomically: whenever the process or the power goes, the old or the new one is there. Returns its bytes; OSError."""
    data = (manifest.model_dump_json(indent=1) + "\n").encode()
    write_atomic(folder / MANIFEST, data, durable=True)
    return len(data)


def read_manifest(folder: Path) -> Manifest:
    """Raises SessionError: not there, damaged, or of a newer version."""
    return _read(folder / MANIFEST, Manifest)


def read_description(folder: Path, manifest: Manifest | None) -> Description:
    """What a session is about: as it was changed last, else as its manifest has it.

    Raises SessionError when what was changed is damaged or of a newer version.
    """
    if (folder / DESCRIPTION).exists():
        return _read(folder / DESCRIPTION, Description)
    return manifest.description if manifest is not None else Description()


def read_about(folder: Path) -> tuple[Manifest | None, Description, list[SessionError]]:
    """Manifest (None: it cannot be read) and description as far as they can be read, and what is wrong with them."""
    manifest: Manifest | None = None
    problems: list[SessionError] = []
    try:
        manifest = read_manifest(folder)
    except SessionError as error:
        problems.append(error)
    try:
        return manifest, read_description(folder, manifest), problems
    except SessionError as error:
        return manifest, manifest.description if manifest is not None else Description(), [*problems, error]


def write_description(folder: Path, description: Description) -> None:
    """Keep a description beside the manifest, atomically, also while the session is recorded; its other files stay as they are.

    Raises SessionError when it cannot be written, or what is there is of a newer version.
    """
    path = folder / DESCRIPTION
    try:
        read_description(folder, None)
    except NewerVersion:
        raise
    except SessionError:  # damaged: what is given now takes its place
        pass
    with disk_errors(SessionError, path, "cannot be written", "; nothing was changed: make the folder writable"):
        write_atomic(path, (json.dumps({"format": FORMAT} | description.model_dump(), indent=1) + "\n").encode(), durable=True)


def remembered_folder() -> Path:
    """Where the description for the next recordings is kept, in a ``description.json`` of its own."""
    return Path(platformdirs.user_state_dir("LumenPilot"))


def remembered_description() -> Description:
    """What the next recordings get; a file that cannot be read says nothing."""
    with contextlib.suppress(SessionError):
        return read_description(remembered_folder(), None).for_next
    return Description()


def remember_description(description: Description) -> None:
    """Keep a description for the next recordings. Raises SessionError."""
    with contextlib.suppress(OSError):  # named when it is written
        remembered_folder().mkdir(parents=True, exist_ok=True)
    write_description(remembered_folder(), description.for_next)


_Read = TypeVar("_Read", bound=BaseModel)


def _read(path: Path, kind: type[_Read]) -> _Read:
    """A JSON file of a session. Raises SessionError: not there, damaged, or of a newer version."""
    with disk_errors(SessionError, path, "cannot be read", missing="missing"), path.open("rb") as file:
        data = file.read(_MAX_BYTES + 1)
    if len(data) > _MAX_BYTES:
        raise SessionError(f"{path}: too large")
    try:
        content = json.loads(data)
        version = content.get("format") if isinstance(content, dict) else None
        if type(version) is int and version > FORMAT:
            raise NewerVersion(f"{path}: format {version} is of a newer version (this one knows {FORMAT}); update the program")
        return kind.model_validate(content)
    except ValidationError as error:
        raise SessionError(f"{path}: damaged ({first_problem(error)})") from None
    except (ValueError, RecursionError):
        raise SessionError(f"{path}: damaged (not valid JSON)") from None


class EventKind(StrEnum):
    """The value is the name kept in files."""

    MODE = "mode"
    ARM = "arm"
    DISARM = "disarm"
    OVERRIDE = "override"
    FAULT = "fault"
    CLEARED = "fault cleared"
    ACKNOWLEDGE = "acknowledge"
    ALERT = "alert"
    TARGET = "target"
    NOTE = "note"
    DROPPED = "frames dropped"
    """By the recorder, which was behind."""
    LOST = "frames lost"
    """By the camera: they never came."""
    VIDEO = "video"


@dataclass(frozen=True, slots=True)
class Event:
    """``time_s`` on the clock of the frames; ``data`` adds what a program may want, as plain JSON values."""

    time_s: float
    kind: EventKind
    text: str = ""
    data: dict[str, Any] = field(default_factory=dict)


def events_between(before: DriveView | None, after: DriveView) -> Iterator[Event]:
    """What changed from one drive view to the next; the first one gives its mode only.

    An override is the operator taking back control while the program drives: driving -> armed, with the operator permitted.
    """
    now_s = after.time_s
    if before is None:
        yield Event(now_s, EventKind.MODE, after.mode.value)
        return
    if after.mode is not before.mode:
        yield Event(now_s, EventKind.MODE, after.mode.value, {"from": before.mode.value})
        if after.mode in ARMED_MODES and before.mode not in ARMED_MODES:
            yield Event(now_s, EventKind.ARM)
        if before.mode in ARMED_MODES and after.mode not in ARMED_MODES:
            yield Event(now_s, EventKind.DISARM, str(after.latched.cause) if after.latched else "")
        if before.mode in DRIVING_MODES and after.mode is Mode.ARMED and after.permitted is Source.OPERATOR:
            yield Event(now_s, EventKind.OVERRIDE, "the operator took back")
    for fault in after.active:
        if fault.cause not in {old.cause for old in before.active}:
            yield Event(now_s, EventKind.FAULT, str(fault.cause), {"detail": fault.detail})
    for fault in before.active:
        if fault.cause not in {new.cause for new in after.active}:
            yield Event(now_s, EventKind.CLEARED, str(fault.cause))
    if before.latched is not None and after.latched is None:
        yield Event(now_s, EventKind.ACKNOWLEDGE, str(before.latched.cause))


def event_of_alert(alert: Alert, time_s: float) -> Event:
    """An alert that was shown."""
    data = {"key": str(alert.key), "detail": alert.detail, "times": alert.times}
    return Event(time_s, EventKind.ALERT, alert.spec.text, data)


REHEARSAL = "rehearsal"
"""Key of what a rehearsal of the target found, in its event (``core/evaluation/rehearsal.py``)."""


def event_of_target(point: Point | None, time_s: float, rehearsal: dict[str, Any] | None = None) -> Event:
    """The target was chosen (source pixels) or cleared, or it was rehearsed."""
    if point is None:
        return Event(time_s, EventKind.TARGET, "cleared")
    text, data = f"{point[0]:.0f}, {point[1]:.0f}", {"xy": [round(point[0], 2), round(point[1], 2)]}
    if rehearsal is None:
        return Event(time_s, EventKind.TARGET, text, data)
    return Event(time_s, EventKind.TARGET, f"{text}, rehearsed", data | {REHEARSAL: rehearsal})


def frames_lost(events: Iterable[Event]) -> int:
    """How many frames never came from the camera, by the events of the recorder."""
    counts = (event.data.get("count") for event in events if event.kind is EventKind.LOST)
    return sum(count for count in counts if type(count) is int and count > 0)


ADDED_LATER = "added_later"
"""Key in the data of an event that was added to a session that had ended: the session's own counts do not include it."""


def was_added_later(event: Event) -> bool:
    return event.data.get(ADDED_LATER) is True


def event_to_json(event: Event) -> dict[str, Any]:
    """A JSON object; numbers that are not finite become None."""
    record: dict[str, Any] = {"time_s": finite(event.time_s, 6), "kind": event.kind.value, "text": event.text}
    return record | ({"data": finite_tree(event.data)} if event.data else {})


class _EventLayout(JsonLayout):
    time_s: Moment
    kind: EventKind
    text: Text = ""
    data: dict[str, Any] = Field(default_factory=dict)


def event_from_json(data: bytes) -> Event:
    """A line of ``events.jsonl``; raises InvalidRecord."""
    return _upgraded(Event(**read_json(_EventLayout, data).__dict__))


_TEXT_OF_TARGET = re.compile(r"(-?\d+\.\d), (-?\d+\.\d)")


def _upgraded(event: Event) -> Event:
    """An event of any earlier version as this one writes it: up to November 2026 a target was text alone, "x, y"."""
    if event.kind is EventKind.TARGET and "xy" not in event.data and (written := _TEXT_OF_TARGET.fullmatch(event.text)):
        return replace(event, data=event.data | {"xy": [float(value) for value in written.groups()]})
    return event

"""Rig files: camera, servos and calibration of one bench in one TOML file, in the user's configuration folder.

A file that cannot be used is reported in one line and left as it is; saving a rig again keeps the older file beside the new one.
"""

from __future__ import annotations

import errno
import os
import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Literal, Self

import tomlkit
from pydantic import Field, ValidationError, model_validator

from core.config.calibration import BehaviourConfig, CalibrationConfig, PortConfig
from core.config.files import settings_folder
from core.config.models import (
    CAMERAS,
    RECORDED,
    CameraConfig,
    CameraName,
    Config,
    PursuitConfig,
    RigConfig,
    SegmentationConfig,
    TwinConfig,
)
from core.config.safety import AtClose, ServosConfig
from core.config.section import ConfigSection, first_problem
from core.devices import UserError, disk_errors
from core.files import write_atomic
from core.messages import message

FORMAT = 1
RESERVED = tuple(name for name in CAMERAS.own if name not in RECORDED)
"""What ``--rig`` means without a rig file; plugins' cameras besides."""
_NAME = re.compile(r"^[\w][\w .()+-]{0,59}$")
_ENDING, _OLDER = ".toml", ".older.toml"
_MAX_BYTES = 200_000
_HEADER = "A rig of LumenPilot: camera, servos, calibration. Made by the rig wizard (menu Rig, or main.py rig calibrate)."


class RigFileError(UserError):
    """A rig file cannot be read, found or saved; one line names file, key and what is wrong."""


class RigFile(ConfigSection):
    """One bench. ``twin`` is there when its camera is the twin's."""

    format: int = Field(FORMAT, ge=1)
    name: str = Field(min_length=1, max_length=60)
    made_utc: datetime
    kind: CameraName
    robot: Literal["twin", "servos", "none"]
    camera: CameraConfig = CameraConfig()
    twin: TwinConfig | None = None
    servos: ServosConfig = ServosConfig()
    calibration: CalibrationConfig | None = None
    bench: str | None = Field(None, min_length=1, description="folder of the bench, from the rig file's own folder")
    model: str | None = Field(None, min_length=1, description="model that was taught on this bench; empty: as in the settings")
    behaviour: BehaviourConfig | None = Field(None, description="of the robot, for the twin of this bench; empty: not identified")
    pursuit: dict[str, float] | None = Field(None, description="settings of policy.pursuit, tuned on this bench (rehearse --tune)")
    keyboard_deadman: bool = Field(False, description="real servos: the program may drive with the deadman on the keyboard alone")

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        check_rig_name(self.name)
        try:
            PursuitConfig.model_validate(PursuitConfig().model_dump() | (self.pursuit or {}))
        except ValidationError as error:
            raise ValueError(f"pursuit: {first_problem(error)}") from None
        if self.kind in RECORDED:
            raise ValueError("kind must be that of a camera")
        if (self.kind == "twin") is not (self.twin is not None):
            raise ValueError("a twin needs the section twin, and no other rig has one")
        if (self.robot == "twin") and self.kind != "twin":
            raise ValueError("a real camera does not see the twin's robot: robot must be servos or none")
        if self.robot == "servos" and (self.kind == "twin" or self.servos.port is None):
            raise ValueError("robot servos needs a real camera and servos.port")
        if self.calibration is not None and (misfit := self.calibration.misfit(self.servos)):
            raise ValueError(f"{misfit}: calibrate again")
        if self.kind == "twin" and self.servos.driver != "dynamixel":
            raise ValueError("servos.driver: the twin has DYNAMIXEL servos of its own: leave it out")
        if self.robot == "servos" and self.servos.too_loose:
            raise ValueError(f"servos: {self.servos.too_loose}")
        return self


@dataclass(frozen=True, slots=True)
class ListedRig:
    """A rig file in the folder; ``rig``: None when it cannot be used; ``problem`` says why."""

    name: str
    path: Path
    rig: RigFile | None
    problem: str = ""


def rigs_folder() -> Path:
    """Where rig files are; it need not exist."""
    return settings_folder() / "rigs"


def check_rig_name(name: str) -> str:
    """The name without blanks around it. Raises ValueError for one that makes no good file name, or means something else."""
    name = name.strip()
    if not _NAME.match(name):
        raise ValueError("a rig's name has 1 to 60 letters, digits, or - _ . ( ) +, and begins with a letter or digit")
    if name.casefold() in RESERVED or name.casefold().endswith(".older"):
        raise ValueError(message("a rig cannot be called {name}: choose another name", name=name))
    return name


def rig_path(name: str) -> Path:
    """The file of a rig of this name: an existing one, also in another case, or a new one."""
    path = rigs_folder() / f"{name.strip()}{_ENDING}"
    if path.exists():
        return path
    alike = (one.path for one in list_rigs() if one.path.name.casefold() == path.name.casefold())
    return next(alike, path)


def list_rigs() -> tuple[ListedRig, ...]:
    """All rigs by name, including those that cannot be used. A folder that cannot be read has none."""
    try:
        paths = [path for path in rigs_folder().glob(f"*{_ENDING}") if not path.name.endswith(_OLDER)]
    except OSError:
        paths = []
    found = []
    for path in sorted(paths, key=lambda path: path.stem.casefold()):
        try:
            rig = read_rig(path)
        except RigFileError as error:
            found.append(ListedRig(path.stem, path, None, str(error)))
        else:
            found.append(ListedRig(path.stem, path, rig))  # not the name inside: the file may be a copy
    return tuple(found)


def find_rig(name: str) -> tuple[Path, RigFile]:
    """The rig of this name, whatever its case. Raises RigFileError, which lists the known ones.

    The file's name goes before the one inside, which a copy of the file keeps, and the exact name before another case.
    """
    listed, wanted = list_rigs(), name.strip()
    folded = wanted.casefold()
    for rank in range(4):
        for rig in listed:
            stem = rig.path.stem
            inside = rig.rig.name if rig.rig is not None else stem
            if (stem == wanted, inside == wanted, stem.casefold() == folded, inside.casefold() == folded)[rank]:
                if rig.rig is None:
                    raise RigFileError(rig.problem)
                return rig.path, rig.rig
    if name.strip().casefold() in RESERVED:
        raise RigFileError(f"{name}: is built in and has no file; rigs with one: {', '.join(rig.name for rig in listed) or 'none'}")
    known = ", ".join((*RESERVED, *(rig.name for rig in listed)))
    raise RigFileError(f"unknown rig {name!r}; known: {known}")


def has_rig(name: str) -> bool:
    """Whether there is a file of this name, valid or not, whatever its case."""
    wanted = name.strip().casefold()
    return any(wanted in {rig.name.casefold(), (rig.rig.name if rig.rig else "").casefold()} for rig in list_rigs())


def read_rig(path: Path) -> RigFile:
    """Read and check a rig file; raises RigFileError. The file is never changed."""
    with disk_errors(RigFileError, path, "cannot be read", missing="no such rig file; main.py rig list names those that there are"):
        data = path.read_bytes()
    if len(data) > _MAX_BYTES:
        raise RigFileError(f"{path}: too large for a rig file")
    try:
        content = tomllib.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # not TOMLDecodeError alone: a number of 5000 digits is another ValueError
        raise RigFileError(
            f"{path}: no TOML ({' '.join(str(error).split())}); the file is kept: mend it, or calibrate anew"
        ) from None
    version = content.get("format")
    if type(version) is int and version > FORMAT:
        raise RigFileError(f"{path}: format {version} is of a newer version (this one knows {FORMAT}); update the program")
    try:
        return RigFile.model_validate(content)
    except ValidationError as error:
        raise RigFileError(f"{path}: {first_problem(error)}; the file is kept: mend it, or calibrate anew") from None


def write_rig(rig: RigFile, path: Path | None = None, *, keeps_older: bool = True) -> Path:
    """Save a rig atomically. Raises RigFileError.

    An older file of that name, whatever its case, stays beside it as NAME.older.toml; without `keeps_older` that one is left alone,
    so that the previous calibration outlives small changes of the present one.
    """
    target = path if path is not None else rig_path(rig.name)
    document = tomlkit.document()
    document.add(tomlkit.comment(_HEADER))
    document.update(rig.model_dump(mode="json", exclude_none=True))
    with disk_errors(RigFileError, target, "cannot be saved"):
        target.parent.mkdir(parents=True, exist_ok=True)
        older = target.with_name(target.stem + _OLDER) if keeps_older else None
        write_atomic(target, tomlkit.dumps(document).encode(), durable=True, older=older)
    return target


def check_can_save(name: str) -> None:
    """Raise RigFileError when a rig of this name could not be saved: before minutes of calibration, not after them."""
    target = rig_path(name)
    with disk_errors(RigFileError, target, "cannot be saved"):
        target.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=target.parent):
            pass  # permissions alone do not show that a disk is mounted read-only
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))


def make_rig(config: Config, name: str, calibration: CalibrationConfig | None) -> RigFile:
    """The bench of a configuration as a rig file, with what its present file was taught; raises RigFileError.

    A recording, and a bad name, are refused.
    """
    kind = config.rig.camera
    if kind in RECORDED or config.rig.source is not None:
        raise RigFileError(f"rig {config.rig.name} plays a recording: it cannot be saved as a rig")
    port = None if kind == "twin" or config.rig.robot == "none" else config.servos.port
    before = None
    with suppress(RigFileError):  # a file that has gone since must not cost the calibration
        before = rig_in_use(config)
    bench = str((before[0].parent / before[1].bench).absolute()) if before is not None and before[1].bench is not None else None
    # the identified robot is one of these ways per turn: with others its pull and feed are counted again
    is_same = before is not None and [one.mm_per_turn for one in before[1].servos.joints] == [
        one.mm_per_turn for one in config.servos.joints
    ]
    try:
        return RigFile.model_validate(
            {
                "name": name.strip(),
                "made_utc": datetime.now(UTC).replace(microsecond=0),
                "kind": kind,
                "robot": config.rig.robot,
                "camera": config.camera,
                "twin": config.twin if kind == "twin" else None,
                "servos": config.servos.model_copy(update={"port": port}),
                "calibration": calibration,
                "bench": bench,
                "model": before[1].model if before is not None else None,
                "behaviour": before[1].behaviour if before is not None and is_same else None,
                "pursuit": before[1].pursuit if before is not None else None,
                "keyboard_deadman": before is not None and before[1].keyboard_deadman,
            }
        )
    except ValidationError as error:
        raise RigFileError(f"rig {name}: {first_problem(error)}") from None


def with_rig(base: Config, rig: RigFile, path: Path) -> Config:
    """The configuration with the rig's camera, servos, twin and taught model. Its name is the file's."""
    chosen = RigConfig(name=path.stem, camera=rig.kind, robot=rig.robot, file=str(path))
    update: dict[str, Any] = {"rig": chosen, "camera": rig.camera, "servos": rig.servos}
    if rig.twin is not None:
        update["twin"] = rig.twin
    model = rig.model or (SegmentationConfig().model if _has_own_model(base) else None)
    if model is not None:
        segmentation = base.perception.segmentation.model_copy(update={"model": model})
        update["perception"] = base.perception.model_copy(update={"segmentation": segmentation})
    return base.model_copy(update=update)


def _has_own_model(config: Config) -> bool:
    """Whether the model is the one that the rig in use was taught with, which another rig must not keep."""
    try:
        found = rig_in_use(config)
    except RigFileError:
        return False
    return found is not None and found[1].model is not None and found[1].model == config.perception.segmentation.model


def sections_of_rig(running: Config, settings: Config) -> frozenset[str]:
    """The sections of `running` that come from its rig file and not from the settings.

    Settings that name the file themselves (`rig.file`) take its calibration only.
    """
    if running.rig.file is None or running.rig == settings.rig:
        return frozenset()
    return frozenset({"camera", "servos", "twin"} if running.rig.camera == "twin" else {"camera", "servos"})


def read_again(running: Config, settings: Config) -> Config:
    """The running configuration with camera, servos and twin as the rig file, which may have been edited, has them now.

    A phantom or a model that was picked stays. Settings that name the file themselves keep their own sections, as do the twin,
    another camera or a recording that was chosen instead of them. Raises RigFileError.
    """
    if running.rig.file is None or not sections_of_rig(running, settings):
        return running
    path = Path(running.rig.file)
    if running.rig.source is not None or running.rig.name != path.stem:
        return running
    rig = read_rig(path)
    if rig.twin is not None and running.rig.camera == "twin":
        rig = rig.model_copy(update={"twin": rig.twin.model_copy(update={"phantom": running.twin.phantom})})
    return with_rig(running, rig, path).model_copy(update={"perception": running.perception})


def rig_in_use(config: Config) -> tuple[Path, RigFile] | None:
    """The rig file of the configured rig; None without one, and for recordings. Raises RigFileError."""
    if config.rig.file is None or config.rig.source is not None or config.rig.camera in RECORDED:
        return None
    path = Path(config.rig.file)
    return path, read_rig(path)


def calibration_of(config: Config) -> CalibrationConfig | None:
    """The calibration of the configured rig; None without a rig file, and for recordings, whose pictures are undistorted already.

    Raises RigFileError.
    """
    found = rig_in_use(config)
    return found[1].calibration if found is not None else None


def scaled(config: Config, known: CalibrationConfig | None) -> Config:
    """The configuration with the measured scale as ``policy.pursuit.pixels_per_mm``; unchanged without one for such pictures."""
    camera, twin = config.camera, config.twin
    is_twin = config.rig.camera == "twin"
    size = (twin.image_width_px, twin.image_height_px) if is_twin else (camera.width_px, camera.height_px)
    if known is None or known.scale is None or not known.scale.fits(size):
        return config
    zoom = known.scale.working_px_per_mm(config.perception.working_size_px)
    pursuit = config.policy.pursuit.model_copy(update={"pixels_per_mm": zoom})
    return config.model_copy(update={"policy": config.policy.model_copy(update={"pursuit": pursuit})})


def _steered(config: Config, known: CalibrationConfig | None) -> Config:
    """The configuration with the learnt turn of the head at full bend as ``policy.drive.turn_deg``; unchanged without one."""
    steering = known.steering if known is not None else None
    if steering is None or steering.turn_deg_per_mm is None:
        return config
    full_deg = min(max(steering.turn_deg_per_mm * config.servos.max_pull_mm, _LEAST_TURN_DEG), _MOST_TURN_DEG)
    drive = config.policy.drive.model_copy(update={"turn_deg": full_deg})
    return config.model_copy(update={"policy": config.policy.model_copy(update={"drive": drive})})


def with_pursuit(config: Config, tuned: Mapping[str, float]) -> Config:
    """The configuration with these settings of ``policy.pursuit``."""
    pursuit = config.policy.pursuit.model_copy(update=dict(tuned))
    return config.model_copy(update={"policy": config.policy.model_copy(update={"pursuit": pursuit})})


_LEAST_TURN_DEG, _MOST_TURN_DEG = 10.0, 720.0
"""Ends of ``policy.drive.turn_deg`` from a rig file: less turn than that would make the steering too strong."""


def as_calibrated(config: Config) -> Config:
    """The configuration with scale, steering, insertion port and bench of its rig file. Raises RigFileError."""
    found = rig_in_use(config)
    known = found[1].calibration if found is not None else None
    config = _steered(scaled(config, known), known)
    config = with_pursuit(config, found[1].pursuit or {}) if found is not None else config
    if found is not None and found[1].bench is not None:
        bench = str(found[0].parent / found[1].bench)  # an absolute one stays
        config = config.model_copy(update={"perception": config.perception.model_copy(update={"bench": bench})})
    if known is None or known.port is None:
        return config
    place = {"port_x_share": known.port.x_share, "port_y_share": known.port.y_share}
    path = config.perception.path.model_copy(update=place)
    return config.model_copy(update={"perception": config.perception.model_copy(update={"path": path})})


def set_bench(path: Path, folder: Path | None, model: str | None = None) -> None:
    """Name the bench's folder in a rig file, and the model that was taught on it; None: not known. Raises RigFileError."""
    bench = str(folder.absolute()) if folder is not None else None
    write_rig(read_rig(path).model_copy(update={"bench": bench, "model": model}), path, keeps_older=False)


def set_at_close(path: Path, how: AtClose) -> None:
    """Save in a rig file what becomes of servos that hold when the program is closed. Raises RigFileError."""
    rig = read_rig(path)
    write_rig(rig.model_copy(update={"servos": rig.servos.model_copy(update={"at_close": how})}), path, keeps_older=False)


def set_behaviour(path: Path, behaviour: BehaviourConfig) -> None:
    """Save in a rig file how its robot behaves. Raises RigFileError."""
    write_rig(read_rig(path).model_copy(update={"behaviour": behaviour}), path, keeps_older=False)


def set_pursuit(path: Path, tuned: Mapping[str, float]) -> None:
    """Save in a rig file which settings of ``policy.pursuit`` were tuned on its bench. Raises RigFileError."""
    write_rig(read_rig(path).model_copy(update={"pursuit": dict(tuned)}), path, keeps_older=False)


def set_port(path: Path, port: PortConfig | None) -> None:
    """Save the insertion port in a rig file; None: not known. Raises RigFileError."""
    rig = read_rig(path)
    known = rig.calibration or CalibrationConfig(made_utc=datetime.now(UTC).replace(microsecond=0))
    write_rig(rig.model_copy(update={"calibration": known.model_copy(update={"port": port})}), path, keeps_older=False)

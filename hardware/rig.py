"""A rig is a camera and a robot that belong together. ``open_rig`` builds what the configuration names."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.config.calibration import ZeroConfig
from core.config.files import settings_folder
from core.config.models import CAMERAS, CameraConfig, Config, RigConfig, load_config
from core.config.rig_file import RESERVED, calibration_of, find_rig, has_rig, with_rig
from core.config.safety import JointKind, ServosConfig
from core.control.kept_zero import ZeroRequest, all_at_zero
from core.control.robot import GuardedRobot
from core.devices import Camera, DeviceError, UserError, disk_errors
from hardware.cameras.registry import CAMERA_KINDS, FoundCamera, camera_kind
from hardware.cameras.undistorted import UndistortedCamera

if TYPE_CHECKING:
    from hardware.servos.discovery import FoundPort
    from hardware.servos.servo_robot import ServoRobot
    from hardware.simulated_clock import SimulatedClock
    from hardware.twin.process import PrestartedProcesses


class RigKind(StrEnum):
    """What the permanent banner says."""

    SIM = "SIM"
    LIVE = "LIVE"
    PLAYBACK = "PLAYBACK"


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """An open rig.

    ``robot``: None when pictures are only looked at; ``clock`` exists when it is a twin in a process of its own: frames, servos and
    pilot have its time.
    """

    name: str
    kind: RigKind
    camera: Camera
    robot: GuardedRobot | None
    clock: SimulatedClock | None = None

    def close(self) -> None:
        try:
            if self.robot is not None:
                self.robot.close()
        finally:
            self.camera.close()


START_INSERTION_MM = 70.0
"""The twin's robot already lies so far in the vessel when the rig is opened: the first picture shows all that is perceived."""
TWIN_TITLE = "Bench twin (no hardware)"


def kind_of(rig: RigConfig) -> RigKind:
    """What a configured rig is, without opening it."""
    if rig.camera == "twin":
        return RigKind.SIM
    return RigKind.LIVE if camera_kind(rig.camera).live is not None and rig.source is None else RigKind.PLAYBACK


def start_ahead(config: Config) -> PrestartedProcesses | None:
    """Start what a rig loads for seconds, for ``open_rig`` to take over; None where there is nothing, or it cannot be started."""
    if not _has_own_process(config):
        return None
    from hardware.twin.process import PrestartedProcesses

    try:
        return PrestartedProcesses()
    except DeviceError:  # ``open_rig`` tries again, and reports it
        return None


def open_rig(config: Config, ahead: PrestartedProcesses | None = None) -> Rig:
    """Open camera and robot; what was opened is closed again when the rest fails. Frames come undistorted by the rig's lens.

    `ahead` is what ``start_ahead`` gave, perhaps for another rig than this one.

    Raises DeviceError, RigFileError: with one line that says what to do.
    """
    with ExitStack() as unused:
        if ahead is not None:
            unused.callback(ahead.end)
        kind = kind_of(config.rig)
        if kind is RigKind.PLAYBACK:
            return _open_playback(config)
        calibration = calibration_of(config)
        if kind is RigKind.SIM:
            if _has_own_process(config):
                unused.pop_all()
            rig = _open_twin(config, ahead)
        else:
            rig = _open_live(config, calibration.zero if calibration is not None else None)
    if calibration is None or calibration.lens is None:
        return rig
    return replace(rig, camera=UndistortedCamera(rig.camera, calibration.lens))


def _open_playback(config: Config) -> Rig:
    """Pictures that were taken before, without a robot."""
    rig = config.rig
    if rig.source is None:
        raise DeviceError(f"rig {rig.name}: camera {rig.camera} needs rig.source, the path of the video or folder")
    _check_no_bag(Path(rig.source))
    play = camera_kind(rig.camera).recorded
    if play is None:
        raise DeviceError(f"rig {rig.name}: a {rig.camera} plays no files: leave rig.source out, or set rig.camera to video_file")
    source = Path(rig.source)
    camera = play(source)
    camera.open()
    return Rig(source.name, RigKind.PLAYBACK, camera, None)


def _open_live(config: Config, zero: ZeroConfig | None) -> Rig:
    """A real camera, with the servos when the rig has some. They are checked, but neither zeroed nor armed."""
    rig = config.rig
    if rig.robot == "twin":
        raise DeviceError(f'rig {rig.name}: a real camera does not see the twin\'s robot: set rig.robot to "servos" or "none"')
    if rig.robot == "servos" and config.servos.port is None:
        raise DeviceError(f'rig {rig.name}: set servos.port (ls /dev/serial/by-id), or rig.robot = "none"')
    camera = real_camera(config)
    with ExitStack() as undo:
        camera.open()
        undo.callback(camera.close)
        robot: ServoRobot | None = None
        if rig.robot == "servos":
            from hardware.servos.eeprom import backups_folder
            from hardware.servos.servo_robot import ServoRobot

            robot = ServoRobot(
                config.servos, config.safety, name=rig.name, keep=kept_zeros_file(rig), searched=zero, backups=backups_folder()
            )
            robot.connect()
        undo.pop_all()
    return Rig(rig.name, RigKind.LIVE, camera, robot)


def kept_zeros_file(rig: RigConfig) -> Path:
    """Where the bus process keeps how the joints of a rig stand."""
    name = re.sub(r"[^\w .()+-]", "_", Path(rig.file).stem if rig.file is not None else rig.name)
    return settings_folder() / "zeros" / f"{name}.json"


def real_camera(config: Config) -> Camera:
    """The camera of a live rig, not open yet."""
    live = camera_kind(config.rig.camera).live
    assert live is not None
    return live(config.camera)


def _has_own_process(config: Config) -> bool:
    """Whether this is a twin with servos, in a process of its own."""
    return kind_of(config.rig) is RigKind.SIM and config.rig.robot == "twin" and config.servos.port is None


def _open_twin(config: Config, ahead: PrestartedProcesses | None) -> Rig:
    if config.rig.robot == "servos":
        raise DeviceError(
            f'rig {config.rig.name}: the twin has servos of its own: set rig.robot = "twin", or rig.camera to a real one'
        )
    if config.rig.robot == "twin" and config.servos.port is not None:
        raise DeviceError(f"rig {config.rig.name} has servos of its own: leave servos.port ({config.servos.port}) out")
    if config.rig.robot == "twin":
        return _open_remote_twin(config, ahead)
    from hardware.twin.world import TwinCamera, TwinWorld

    try:
        world = TwinWorld(config.twin, perception=config.perception, servos=config.servos, safety=config.safety)
    except ValueError as error:
        raise DeviceError(str(error)) from None
    world.insert(START_INSERTION_MM)
    camera = TwinCamera(world)
    camera.open()
    return Rig(config.rig.name, RigKind.SIM, camera, None)


def _open_remote_twin(config: Config, ahead: PrestartedProcesses | None) -> Rig:
    """The twin and its software servos in a process of their own, the real driver in another; zeroed, not armed."""
    from hardware.servos.servo_robot import ServoRobot
    from hardware.twin.process import PrestartedProcesses

    loading = ahead or PrestartedProcesses()
    with ExitStack() as undo:
        undo.callback(loading.end)
        twin = loading.open_twin(config, START_INSERTION_MM)
        undo.callback(twin.close)
        servos = config.servos.model_copy(update={"port": twin.port, "driver": "dynamixel"})
        name, safety = "bench twin with servos", config.safety
        robot = ServoRobot(servos, safety, name=name, truth=twin.status, process=loading.bus, clock=twin.clock)
        undo.callback(robot.close)
        robot.connect()
        robot.zero(_zero_of_twin(servos))
        undo.pop_all()
    return Rig(config.rig.name, RigKind.SIM, twin, robot, clock=twin.clock)


def _zero_of_twin(servos: ServosConfig) -> ZeroRequest:
    """Its wires are slack, as nothing has pulled yet; the robot is inserted already, as far as its feed's envelope lets it be."""
    feeds = servos.joints[servos.places(JointKind.ADVANCE)]
    inserted_mm = {joint.name: max(joint.low_mm, min(joint.high_mm, START_INSERTION_MM)) for joint in feeds}
    return ZeroRequest(positions_mm=all_at_zero(servos).positions_mm | inserted_mm)


@dataclass(frozen=True, slots=True)
class FoundDevices:
    """Cameras and serial ports of this computer, and why some could not be searched for."""

    cameras: tuple[FoundCamera, ...]
    ports: tuple[FoundPort, ...]
    problems: tuple[str, ...] = ()


def find_devices() -> FoundDevices:
    """Cameras, the twin last, and serial ports. A kind of camera that cannot be searched for is a problem, not the end."""
    from hardware.servos.discovery import find_ports

    cameras: list[FoundCamera] = []
    problems = []
    for kind in CAMERA_KINDS.values():
        try:
            # a RealSense that is in the list already can do less as a webcam
            cameras += [c for c in kind.find() if not (cameras and c.kind == "webcam" and "RealSense" in c.title)]
        except (ImportError, DeviceError) as error:
            problems.append(f"{kind.title}: {' '.join(str(error).split())}")
    cameras += [FoundCamera(name, name) for name in CAMERAS.plugins]  # whether they are plugged in is not known
    return FoundDevices((*cameras, FoundCamera("twin", TWIN_TITLE)), find_ports(), tuple(problems))


def with_camera(config: Config, camera: FoundCamera) -> Config:
    """The configuration with this camera; real ones keep the servos when a port is known."""
    if camera.kind == "twin":
        rig = RigConfig(name="twin", camera="twin", robot="twin")
        return config.model_copy(update={"rig": rig, "servos": config.servos.model_copy(update={"port": None})})
    settings = CameraConfig.model_validate({**config.camera.model_dump(), "serial": camera.serial, "device": camera.device})
    robot = "servos" if config.servos.port is not None else "none"
    rig = RigConfig.model_validate({"name": camera.kind, "camera": camera.kind, "robot": robot})
    return config.model_copy(update={"rig": rig, "camera": settings})


def with_port(config: Config, port: str | None) -> Config:
    """The configuration with its servos on `port`; None: pictures are only looked at. A twin has servos of its own."""
    if config.rig.camera == "twin":
        return config
    rig = config.rig.model_copy(update={"robot": "servos" if port is not None else "none"})
    return config.model_copy(update={"rig": rig, "servos": config.servos.model_copy(update={"port": port})})


def rig_config(
    rig: str | None, config_path: Path | None, source: Path | None, own: dict[str, Any] | None = None
) -> tuple[Config, RigKind]:
    """The configuration of a rig or of a recorded source, and its kind.

    `rig` is a built-in one or a rig file's name; None: the one that the configuration names. `source` is a recording, file or
    folder of pictures, instead of a rig; `own` are settings of the user, over the defaults.

    Raises UserError: for contradicting or unknown names; DeviceError for a source that cannot be read.
    """
    if rig is not None and source is not None:
        raise UserError("--source is looked at instead of a rig's camera: leave --rig out")
    config = load_config(config_path, overrides=own)
    if source is None:
        if rig is None:
            return config, kind_of(config.rig)
        if rig in RESERVED or (rig in CAMERAS.plugins and not has_rig(rig)):
            config = _built_in_rig(config, rig)
        else:
            path, found = find_rig(rig)
            config = with_rig(config, found, path)
    else:
        config = with_source(config, source)
    return config, kind_of(config.rig)


def with_source(config: Config, source: Path) -> Config:
    """The configuration with a recording, file or folder of pictures instead of the rig's camera. Raises DeviceError, UserError."""
    with disk_errors(DeviceError, source, "cannot be read"):
        exists = source.exists()
    if not exists:
        raise DeviceError(f"{source}: no such file or folder")
    from core.files import VIDEO_ENDINGS

    _check_no_bag(source)
    camera = "video_file" if source.suffix.lower() in VIDEO_ENDINGS else "image_folder"
    if camera == "image_folder" and source.is_file():
        _check_picture(source)
    chosen = {"camera": camera, "robot": "none", "source": str(source), "file": None}
    return config.model_copy(update={"rig": RigConfig.model_validate(config.rig.model_dump() | chosen)})


def _check_no_bag(source: Path) -> None:
    if source.suffix.lower() == ".bag":
        raise DeviceError(
            f"{source}: RealSense recordings are not played: rs-convert -c -i {source} -p FOLDER/ writes their pictures"
        )


def _check_picture(file: Path) -> None:
    """A file that is no video by its name must be a picture: refused here, not in a window that would show nothing."""
    from core.files import VIDEO_ENDINGS, ImageError, read_image
    from core.learning.dataset import IMAGE_ENDINGS

    try:
        read_image(file)
    except ImageError as error:
        if file.suffix.lower() in IMAGE_ENDINGS:
            raise
        endings = ", ".join((*IMAGE_ENDINGS, *VIDEO_ENDINGS))
        raise UserError(f"{error}; --source takes a folder of pictures, or a file that ends in {endings}") from None


def _built_in_rig(config: Config, rig: str) -> Config:
    """Another rig than the configuration's own: a real camera drives real servos when their port is known."""
    if config.rig.camera == rig and config.rig.source is None:
        return config
    servos = config.servos
    if rig == "twin":
        robot, servos = "twin", servos.model_copy(update={"port": None})
    else:
        robot = "servos" if servos.port is not None else "none"
    # Without its file: what was calibrated is another camera's.
    chosen = config.rig.model_copy(update={"name": rig, "camera": rig, "robot": robot, "source": None, "file": None})
    return config.model_copy(update={"rig": chosen, "servos": servos})

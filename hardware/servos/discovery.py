"""Which serial ports there are, and which servos answer on one. Nothing moves, and no register is written.

USB, V4L2 and serial adapters as the kernel lists them in sysfs; nothing is opened.

Which cameras and serial ports this computer has, for somebody who sets up a rig. Nothing is opened for longer than a look.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from serial.tools import list_ports

from core.config.models import CameraConfig, Config, RigConfig
from core.config.safety import JOINT_NAMES
from core.devices import DeviceError
from hardware.servos.dynamixel_port import NoAnswer, ServoLine

if TYPE_CHECKING:
    from hardware.cameras.realsense import RealSenseInfo


DEV, SYS = Path("/dev"), Path("/sys")
_INTEL, _REALSENSE = "8086", "realsense"
USB3_MBIT_S = 5000


@dataclass(frozen=True, slots=True)
class UsbDevice:
    """A plugged-in device; ``mbit_s`` is the speed of its connection (480: USB 2, 5000 and more: USB 3)."""

    product: str
    serial: str
    mbit_s: int


@dataclass(frozen=True, slots=True)
class VideoDevice:
    """A V4L2 node that may be a webcam; ``stable`` is its path in /dev/v4l/by-id, None when the system makes none."""

    node: Path
    title: str
    stable: Path | None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def realsense_on_usb(sys: Path = SYS) -> list[UsbDevice]:
    """RealSense cameras that are plugged in, whether or not they may be opened."""
    found = []
    for folder in sorted((sys / "bus" / "usb" / "devices").glob("*")):
        product = _text(folder / "product")
        if _text(folder / "idVendor") == _INTEL and _REALSENSE in product.lower():
            speed = _text(folder / "speed")
            found.append(UsbDevice(product, _text(folder / "serial"), int(float(speed)) if speed.replace(".", "").isdigit() else 0))
    return found


def video_devices(dev: Path = DEV, sys: Path = SYS) -> list[VideoDevice]:
    """V4L2 nodes that give pictures: a camera's first one; its further ones carry metadata."""
    stable: dict[Path, Path] = {}
    for link in sorted((dev / "v4l" / "by-id").glob("*")):
        stable.setdefault(link.resolve(), link)
    found = []
    for folder in sorted((sys / "class" / "video4linux").glob("video*"), key=lambda path: (len(path.name), path.name)):
        if _text(folder / "index") in {"", "0"}:
            node = dev / folder.name
            found.append(VideoDevice(node, _text(folder / "name") or folder.name, stable.get(node.resolve())))
    return found


def latency_timer(port: Path, sys: Path = SYS) -> Path | None:
    """Where the latency of an FTDI adapter's port stands, in ms; None when it is no such adapter."""
    path = sys / "bus" / "usb-serial" / "devices" / port.resolve().name / "latency_timer"
    return path if path.is_file() else None


BAUDS = (1_000_000, 57_600, 115_200, 2_000_000, 3_000_000, 4_000_000)
"""The speeds of these servos, the likeliest first; 57600 is the factory's."""
_TRIES = 3


@dataclass(frozen=True, slots=True)
class FoundPort:
    """A serial port; ``path`` is the stable one in /dev/serial/by-id where there is one."""

    path: str
    title: str


@dataclass(frozen=True, slots=True)
class FoundServo:
    """A servo that answered."""

    id: int
    model: int


@dataclass(frozen=True, slots=True)
class FoundServos:
    """All that answered on a port, by id, and the speed at which they did."""

    port: str
    baud: int
    servos: tuple[FoundServo, ...]
    elsewhere: tuple[tuple[int, tuple[int, ...]], ...] = ()
    """Other speeds at which others answered, with their ids: one bus has one speed."""

    @property
    def ids(self) -> tuple[int, ...]:
        return tuple(servo.id for servo in self.servos)


def find_ports(dev: Path = DEV) -> tuple[FoundPort, ...]:
    """Serial ports of USB adapters, as the system lists them; none is opened."""
    stable = {link.resolve(): link for link in sorted((dev / "serial" / "by-id").glob("*"))}
    titles = {Path(port.device).resolve(): port.description for port in list_ports.comports() if port.vid is not None}
    nodes = sorted({*stable, *titles}, key=lambda node: node.name)
    return tuple(FoundPort(str(stable.get(node, node)), titles.get(node, "") or node.name) for node in nodes)


def _nothing() -> None:
    """Nobody wants to know."""


def find_servos(
    port: str,
    bauds: Sequence[int] = BAUDS,
    said: Callable[[str], object] = lambda _: None,
    stopped: Callable[[], None] = _nothing,
) -> FoundServos:
    """Ask everybody who he is, at one speed after the other, until seven answer; where they never do, those of the fullest speed.

    Parameters
    ----------
    said : told what is being tried.
    stopped : called in between; may raise to end the search.

    Raises
    ------
    PortError
        The port is missing, not permitted, in use, or no serial port.
    NoAnswer
        Nobody answers at any speed.
    """
    answered: dict[int, tuple[FoundServo, ...]] = {}
    for baud in bauds:
        stopped()
        said(f"asking at {baud} baud")
        line = ServoLine(port, baud)
        line.open()
        try:
            found = [FoundServo(servo_id, model) for servo_id in _ids(line) if (model := _model(line, servo_id)) is not None]
        finally:
            line.close()
        if found:
            answered[baud] = tuple(found)
        if len(found) >= len(JOINT_NAMES):
            break
    if answered:
        fullest = max(answered, key=lambda baud: len(answered[baud]))
        others = tuple((baud, tuple(one.id for one in found)) for baud, found in answered.items() if baud != fullest)
        return FoundServos(port, fullest, answered[fullest], others)
    speeds = ", ".join(map(str, bauds))
    raise NoAnswer(f"no servo answers on {port} (asked at {speeds} baud): switch their 12 V on, check the cable to the adapter")


def _ids(line: ServoLine) -> list[int]:
    """Who answers. All talk after one another then, and whoever is missed speaks up in the next round."""
    ids = set(line.others())
    for _ in range(_TRIES - 1):
        if not ids or len(ids) >= len(JOINT_NAMES):
            break
        ids |= set(line.others())
    return sorted(ids)


def _model(line: ServoLine, servo_id: int) -> int | None:
    """Model number; None when the servo falls silent again."""
    for _ in range(_TRIES):
        if (model := line.ping(servo_id)) is not None:
            return model
    return None


TWIN_TITLE = "Bench twin (no hardware)"


@dataclass(frozen=True, slots=True)
class FoundCamera:
    """A camera that a rig can have. ``serial`` of a RealSense, ``device`` of a webcam."""

    kind: Literal["twin", "realsense", "webcam"]
    title: str
    serial: str | None = None
    device: str | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """All that was found, and what went wrong on the way."""

    cameras: tuple[FoundCamera, ...]
    ports: tuple[FoundPort, ...]
    problems: tuple[str, ...] = ()


def _realsense() -> Sequence[RealSenseInfo]:
    from hardware.cameras.realsense import find_cameras

    return find_cameras()


def search(found: Callable[[], Sequence[RealSenseInfo]] = _realsense, dev: Path = DEV, sys: Path = SYS) -> Found:
    """Cameras, the twin last, and serial ports. What cannot be asked is a problem, and no end of the search."""
    cameras: list[FoundCamera] = []
    problems = []
    try:
        cameras += [FoundCamera("realsense", camera.describe(), serial=camera.serial) for camera in found()]
    except (ImportError, DeviceError) as error:
        problems.append(f"RealSense: {' '.join(str(error).split())}")
    for device in video_devices(dev, sys):
        if cameras and "RealSense" in device.title:
            continue  # it is in the list already, and can do less as a webcam
        path = str(device.stable or device.node)
        cameras.append(FoundCamera("webcam", f"{device.title} ({path})", device=path))
    cameras.append(FoundCamera("twin", TWIN_TITLE))
    return Found(tuple(cameras), find_ports(dev), tuple(problems))


def with_camera(config: Config, camera: FoundCamera) -> Config:
    """The configuration with this camera; real ones keep the servos when a port is known."""
    if camera.kind == "twin":
        rig = RigConfig(name="twin", camera="twin", robot="twin")
        return config.model_copy(update={"rig": rig, "servos": config.servos.model_copy(update={"port": None})})
    settings = CameraConfig.model_validate({**config.camera.model_dump(), "serial": camera.serial, "device": camera.device})
    rig = RigConfig(name=camera.kind, camera=camera.kind, robot="servos" if config.servos.port is not None else "none")
    return config.model_copy(update={"rig": rig, "camera": settings})


def with_port(config: Config, port: str | None) -> Config:
    """The configuration with its servos on `port`; None: pictures are only looked at. A twin has servos of its own."""
    if config.rig.camera == "twin":
        return config
    rig = config.rig.model_copy(update={"robot": "servos" if port is not None else "none"})
    return config.model_copy(update={"rig": rig, "servos": config.servos.model_copy(update={"port": port})})

"""Which cameras and serial ports this computer has, for somebody who sets up a rig. Nothing is opened for longer than a look."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from core.camera_config import CameraConfig
from core.config import Config, RigConfig
from core.devices import DeviceError
from hardware.servos.search import FoundPort, find_ports
from hardware.usb import DEV, SYS, video_devices

if TYPE_CHECKING:
    from hardware.cameras.realsense import RealSenseInfo

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

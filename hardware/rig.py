"""A rig is a camera and a robot that belong together. ``open_rig`` builds what the configuration names."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from core.config import Config
from core.devices import Camera, DeviceError, Robot

if TYPE_CHECKING:
    from hardware.twin.world import TwinWorld


class RigKind(StrEnum):
    """What the permanent banner says."""

    SIM = "SIM"
    LIVE = "LIVE"
    PLAYBACK = "PLAYBACK"


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """An open rig. ``robot`` is None when pictures are only looked at; ``world`` exists when the rig is the twin."""

    name: str
    kind: RigKind
    camera: Camera
    robot: Robot | None
    world: TwinWorld | None = None

    @property
    def is_live(self) -> bool:
        return self.kind is RigKind.LIVE

    def close(self) -> None:
        try:
            if self.robot is not None:
                self.robot.close()
        finally:
            self.camera.close()


_START_INSERTION_MM = 70.0


def open_rig(config: Config) -> Rig:
    """Open camera and robot; what was opened is closed again when the rest fails.

    Raises
    ------
    DeviceError
        With one line that says what to do.
    """
    if config.rig.camera == "twin":
        return _open_twin(config)
    if config.rig.source is None:
        raise DeviceError(f"rig {config.rig.name}: camera {config.rig.camera} needs rig.source, the path of the video or folder")
    source = Path(config.rig.source)
    from hardware.cameras.image_folder import ImageFolder
    from hardware.cameras.video_file import VideoFile

    camera: Camera = VideoFile(source) if config.rig.camera == "video_file" else ImageFolder(source)
    camera.open()
    return Rig(source.name, RigKind.PLAYBACK, camera, None)


def _open_twin(config: Config) -> Rig:
    from hardware.twin.camera import TwinCamera
    from hardware.twin.world import TwinWorld

    try:
        world = TwinWorld(config.twin, perception=config.perception)
    except ValueError as error:
        raise DeviceError(str(error)) from None
    # A robot that already lies in the vessel: the first picture shows all that the program can tell.
    world.insert(_START_INSERTION_MM)
    camera = TwinCamera(world)
    robot = world.robot if config.rig.robot == "twin" else None
    if robot is not None:
        robot.connect()
    camera.open()
    return Rig(config.rig.name, RigKind.SIM, camera, robot, world)

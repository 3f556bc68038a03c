"""The bench of a calibration: a camera feed, servos that are moved one at a time or together, the printed board. Real or twin.

Nothing of the operator window runs meanwhile: the bench owns camera and port, and the port's lock refuses other programs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

import numpy as np

from core.calibration.camera import BoardSpec
from core.calibration.servos import HeadNotSeen, Look
from core.config.calibration import LensConfig
from core.config.models import Config
from core.config.safety import ServosConfig
from core.devices import Camera, DeviceError
from core.types import Frame, Image, Reason, Scene
from hardware.calibration.servo_probe import ProbeLimits, ServoProbe, SteeredRobot, StopSwitch, probe_config
from hardware.cameras.live import CameraFeed
from hardware.rig import START_INSERTION_MM, RigKind, kind_of, real_camera
from hardware.servos.eeprom import backups_folder
from hardware.simulated_clock import SimulatedClock

if TYPE_CHECKING:
    from hardware.twin.rendering.calibration_board import BoardPictures


Perceive = Callable[[Frame], Scene]

_FRAMES, _FRAMES_WITHIN_S = 5, 8.0
_PERIOD_S = 0.02


class CalibrationBench:
    """Camera feed, servos and STOP of one rig; ``open_bench`` makes one, ``close`` gives all of it back.

    The procedures in ``servo_identification`` work with it. ``port``: None when the rig has no servos; ``stop`` ends whatever
    moves.
    """

    def __init__(
        self,
        config: Config,
        camera: Camera,
        port: str | None,
        perceive: Perceive,
        on_close: Callable[[], None],
        clock: SimulatedClock | None = None,
    ) -> None:
        self.config, self.port, self._perceive, self._on_close, self._clock = config, port, perceive, on_close, clock
        self.kind = kind_of(config.rig)
        self._backups = backups_folder() if self.kind is RigKind.LIVE else None
        self.stop = StopSwitch()
        self.feed = CameraFeed(camera, clock=clock or time.monotonic)
        self._boards: dict[BoardSpec, BoardPictures] = {}
        self._boards_shown = 0

    def warm_up(self) -> None:
        """Perceive one frame before anything moves: the first one takes a network seconds. Raises DeviceError without one."""
        self._perceive(self.feed.next_frames(1, _FRAMES_WITHIN_S)[0])

    def observe(self, alive: Callable[[], None]) -> Look:
        """Some frames of a robot that stands still; raises HeadNotSeen, with perception's reason, and DeviceError."""
        return observe_robot(self.feed, self._perceive, alive)

    @contextmanager
    def probe(
        self, servos: ServosConfig, servo_id: int, limits: ProbeLimits, sign: Literal[-1, 1], found: Mapping[int, int] | None = None
    ) -> Iterator[ServoProbe]:
        """One servo, zeroed where it stands, armed. Raises ServoError."""
        config = probe_config(servos, servo_id, limits, sign, found)
        with ServoProbe.opened(config, self.config.safety, limits, self.stop, self._backups, self._clock) as probe:
            yield probe

    @contextmanager
    def steer(self, servos: ServosConfig) -> Iterator[SteeredRobot]:
        """All of them, zeroed where they stand, armed. Raises ServoError."""
        with SteeredRobot.opened(servos, self.config.safety, self.stop, self._backups, self._clock) as robot:
            yield robot

    def servos_config(self, servos: ServosConfig) -> ServosConfig:
        """`servos` on this bench's port; raises DeviceError when the rig has no servos."""
        if self.port is None:
            raise DeviceError("this rig has no servo port: choose one, or leave the servos out")
        ends_with_us = {"unattended_s": 0.0} if self.kind is RigKind.SIM else {}
        return servos.model_copy(update={"port": self.port, **ends_with_us})

    def board_picture(self, spec: BoardSpec) -> Image:
        """A picture in which the printed board is looked for, as the lens sees it. In the twin it lies elsewhere in every picture.

        Raises DeviceError when the camera gives no picture.
        """
        if self.kind is RigKind.SIM:
            from hardware.twin.rendering.calibration_board import BoardPictures

            if spec not in self._boards:
                self._boards[spec] = BoardPictures(self.config.twin, spec)
            index, self._boards_shown = self._boards_shown, self._boards_shown + 1
            return self._boards[spec].picture(index, noise_seed=index)
        lens, self.feed.lens = self.feed.lens, None
        try:
            frames = self.feed.next_frames(3, _FRAMES_WITHIN_S, self.stop.check)
        finally:
            self.feed.lens = lens
        return _mean([frame.image for frame in frames])

    def set_lens(self, lens: LensConfig | None) -> None:
        """From now on frames are undistorted."""
        self.feed.lens = lens

    def close(self) -> None:
        """Stop what moves, and give camera and port back; may be called twice."""
        self.stop.press()
        self.feed.close()
        on_close, self._on_close = self._on_close, lambda: None
        on_close()


def open_bench(config: Config, perceive: Perceive) -> CalibrationBench:
    """Open the camera and, in the twin, its servos' port.

    Raises DeviceError: with one line that says what to do; all is closed again.
    """
    kind = kind_of(config.rig)
    if kind is RigKind.PLAYBACK:
        raise DeviceError(f"rig {config.rig.name} plays a recording: only a real camera or the twin can be calibrated")
    if kind is RigKind.LIVE:
        camera = real_camera(config)
        camera.open()
        return CalibrationBench(config, camera, config.servos.port, perceive, lambda: None)
    config = config.model_copy(update={"servos": config.servos.model_copy(update={"port": None})})
    from hardware.twin.process import RemoteTwin

    twin = RemoteTwin(config, START_INSERTION_MM)
    return CalibrationBench(config, twin, twin.port, perceive, twin.close, twin.clock)


def observe_robot(feed: CameraFeed, perceive: Perceive, alive: Callable[[], None]) -> Look:
    """Some frames of a robot that stands still; raises HeadNotSeen, with perception's reason, and DeviceError."""
    frames = feed.next_frames(_FRAMES, _FRAMES_WITHIN_S, alive)
    # Beside the signs of life: on a busy machine a network takes longer than the bus waits for them.
    with ThreadPoolExecutor(1, thread_name_prefix="observe") as pool:
        scenes = pool.submit(lambda: [perceive(frame) for frame in frames])
        while not scenes.done():
            alive()
            wait([scenes], _PERIOD_S)
    paths, why, scale = [], "", 1.0
    for scene in scenes.result():
        # What is measured here moves the robot later: a picture unlike the training data says nothing.
        unknown = scene.refusal is not None and scene.refusal.reason is Reason.UNLIKE_TRAINING
        if scene.path is not None and not unknown:
            paths.append(scene.points_to_source(scene.path.points))
            scale = scene.scale
        elif scene.refusal is not None:
            why = str(scene.refusal)
    try:
        return Look(tuple(paths), _mean([frame.image for frame in frames]), scale)
    except HeadNotSeen as error:
        raise HeadNotSeen(f"{error} ({why})" if why else str(error)) from None


def _mean(images: list[Image]) -> Image:
    return np.asarray(np.round(np.mean(np.array(images, np.float32), axis=0)), np.uint8)

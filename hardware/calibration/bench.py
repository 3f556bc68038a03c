"""The bench of a calibration: a camera that is looked at, servos that are moved one at a time, the printed board. Real or twin.

Nothing of the operator window runs meanwhile: the bench owns camera and port, and the port's lock refuses everybody else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Literal

import numpy as np

from core.calibration.camera import BoardSpec
from core.calibration.servos import HeadNotSeen, Look
from core.config.calibration import LensConfig
from core.config.models import Config
from core.config.safety import JointConfig, SafetyConfig, ServosConfig
from core.devices import Camera, DeviceError
from core.types import Command, Frame, Image, Reason, Scene
from hardware.calibration import servo_probe as probes
from hardware.calibration.servo_identification import Bench
from hardware.calibration.servo_probe import ProbeFailed, ProbeLimits, ServoProbe, StopSwitch, Strained
from hardware.cameras.live import CameraFeed
from hardware.rig import START_INSERTION_MM, RigKind, kind_of, real_camera
from hardware.servos.dynamixel_port import ServoError
from hardware.servos.registers import ServoState
from hardware.servos.servo_robot import ServoRobot

if TYPE_CHECKING:
    from hardware.twin.rendering.calibration_board import BoardPictures
    from hardware.twin.servos.bus import SoftServoBus
    from hardware.twin.world import TwinWorld


See = Callable[[Frame], Scene]

_LOOKS = 5
_LOOK_WITHIN_S = 8.0
_PERIOD_S = 0.02
_BEND_S = 0.6
_STRAINED_CYCLES = 4


class CalibrationBench:
    """Camera feed, servo port and STOP of one rig; ``open_bench`` makes one, ``close`` gives all of it back.

    Attributes
    ----------
    feed : the camera, read all the time.
    port : the servos' serial port; None when the rig has none.
    stop : ends whatever moves.
    world, servos : the twin, where it lives in this process; for tests.
    """

    def __init__(self, config: Config, camera: Camera, port: str | None, see: See, close: Callable[[], None]) -> None:
        self.config, self.port, self._see, self._close = config, port, see, close
        self.kind = kind_of(config.rig)
        self.stop = StopSwitch()
        self.feed = CameraFeed(camera)
        self.world: TwinWorld | None = None
        self.servos: SoftServoBus | None = None
        self._boards: dict[BoardSpec, BoardPictures] = {}
        self._boards_shown = 0

    def warm_up(self) -> None:
        """Perceive one picture before anything moves: the first one takes a network seconds. Raises DeviceError without one."""
        self._see(self.feed.take(1, _LOOK_WITHIN_S)[0])

    @property
    def bench(self) -> Bench:
        """What the procedures want."""
        return Bench(LiveEyes(self.feed, self._see), LiveHands(self.config.safety, self.stop), self.stop)

    def servos_config(self, servos: ServosConfig) -> ServosConfig:
        """`servos` on this bench's port.

        Raises
        ------
        DeviceError
            The rig has no servos.
        """
        if self.port is None:
            raise DeviceError("this rig has no servo port: choose one, or leave the servos out")
        return servos.model_copy(update={"port": self.port})

    def board_picture(self, spec: BoardSpec) -> Image:
        """A picture in which the printed board is looked for, as the lens sees it. In the twin it is laid anew for every picture.

        Raises
        ------
        DeviceError
            The camera gives no picture.
        """
        if self.kind is RigKind.SIM:
            return self._twin_board(spec)
        lens, self.feed.lens = self.feed.lens, None
        try:
            frames = self.feed.take(3, _LOOK_WITHIN_S, self.stop.check)
        finally:
            self.feed.lens = lens
        return _mean([frame.image for frame in frames])

    def _twin_board(self, spec: BoardSpec) -> Image:
        from hardware.twin.rendering.calibration_board import BoardPictures

        if spec not in self._boards:
            self._boards[spec] = BoardPictures(self.config.twin, spec)
        index, self._boards_shown = self._boards_shown, self._boards_shown + 1
        return self._boards[spec].picture(index, noise_seed=index)

    def set_lens(self, lens: LensConfig | None) -> None:
        """From now on pictures are straightened."""
        self.feed.lens = lens

    def close(self) -> None:
        """Stop what moves, and give camera and port back; may be called twice."""
        self.stop.press()
        self.feed.close()
        close, self._close = self._close, lambda: None
        close()


def open_bench(config: Config, see: See) -> CalibrationBench:
    """Open the camera and, in the twin, its servos' port.

    Parameters
    ----------
    see : perception of one frame.

    Raises
    ------
    DeviceError
        With one line that says what to do; all is closed again.
    """
    kind = kind_of(config.rig)
    if kind is RigKind.PLAYBACK:
        raise DeviceError(f"rig {config.rig.name} plays a recording: only a real camera or the twin can be calibrated")
    if kind is RigKind.LIVE:
        camera = real_camera(config)
        camera.open()
        return CalibrationBench(config, camera, config.servos.port, see, lambda: None)
    config = config.model_copy(update={"servos": config.servos.model_copy(update={"port": None})})
    return _own_twin(config, see) if not config.twin.own_process else _remote_twin(config, see)


def _remote_twin(config: Config, see: See) -> CalibrationBench:
    from hardware.twin.process import RemoteCamera, RemoteTwin

    twin = RemoteTwin(config, START_INSERTION_MM)
    return CalibrationBench(config, RemoteCamera(twin), twin.port, see, twin.close)


def _own_twin(config: Config, see: See) -> CalibrationBench:
    from hardware.twin.process import drive_world, wired
    from hardware.twin.servos.bus import SoftServoBus
    from hardware.twin.world import TwinCamera, TwinWorld

    try:
        world, wiring = TwinWorld(config.twin, perception=config.perception), wired(config.twin, config.servos)
    except ValueError as error:
        raise DeviceError(str(error)) from None
    world.insert(START_INSERTION_MM)
    with ExitStack() as undo:
        servos = SoftServoBus(wiring, wire_time=True)
        servos.start()
        undo.callback(servos.stop)
        drive_world(world, servos, wiring)
        camera = TwinCamera(world)
        camera.open()
        undo.pop_all()
    bench = CalibrationBench(config, camera, servos.port, see, servos.stop)
    bench.world, bench.servos = world, servos
    return bench


class LiveEyes:
    """Looks through a camera feed."""

    def __init__(self, feed: CameraFeed, see: See) -> None:
        self._feed, self._see = feed, see

    def look(self, alive: Callable[[], None]) -> Look:
        """Some frames of a robot that stands still; raises HeadNotSeen, with perception's reason, and DeviceError."""
        frames = self._feed.take(_LOOKS, _LOOK_WITHIN_S, alive)
        paths, why, scale = [], "", 1.0
        for scene in self._perceived(frames, alive):
            # What is measured here moves the robot later: a picture of a kind that nobody answers for says nothing.
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

    def _perceived(self, frames: Sequence[Frame], alive: Callable[[], None]) -> list[Scene]:
        """Perceive beside the signs of life: on a busy machine a network takes longer than the bus is patient."""
        with ThreadPoolExecutor(1, thread_name_prefix="look") as pool:
            scenes = pool.submit(lambda: [self._see(frame) for frame in frames])
            while not scenes.done():
                alive()
                wait([scenes], _PERIOD_S)
            return scenes.result()


class LiveHands:
    """Moves servos through the guarded bus process."""

    def __init__(self, safety: SafetyConfig, stop: StopSwitch) -> None:
        self._safety, self._stop = safety, stop

    @contextmanager
    def probe(
        self, servos: ServosConfig, servo_id: int, limits: ProbeLimits, sign: Literal[-1, 1], ids: tuple[int, ...] | None = None
    ) -> Iterator[ServoProbe]:
        """One servo, zeroed where it stands, armed."""
        with ServoProbe.opened(probes.probe_config(servos, servo_id, limits, sign, ids), self._safety, limits, self._stop) as probe:
            yield probe

    @contextmanager
    def steered(self, servos: ServosConfig) -> Iterator[SteeredRobot]:
        """All seven, zeroed where they stand, armed."""
        calm = probes.patient(servos)
        robot = ServoRobot(calm, self._safety, name="robot")
        with probes.armed(robot, self._stop):
            yield SteeredRobot(robot, calm.joints, self._stop)


class SteeredRobot:
    """Bends and holds the robot, and stops when a servo strains."""

    def __init__(
        self,
        robot: ServoRobot,
        joints: tuple[JointConfig, ...],
        stop: StopSwitch,
        max_current_ma: float = probes.MAX_CURRENT_MA,
    ) -> None:
        self._robot, self._joints, self._stop, self._most_ma = robot, joints, stop, max_current_ma
        self._strained = 0
        self._cycle = -1
        self._hiccups = probes.Hiccups(robot, stop, "the robot")
        self._command = Command()

    def bend_to(self, command: Command) -> None:
        """Bend at the gate's own pace, and wait until it has stopped."""
        self._command = command
        self.pause(_BEND_S)

    def pause(self, seconds: float) -> None:
        """Keep the bend for a while."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.alive()
            self._stop.sleep(_PERIOD_S)

    def alive(self) -> None:
        """Keep the bend; raises what is wrong."""
        self._stop.check()
        status = self._robot.bus_status()
        if (failure := self._robot.failure) is not None:
            raise ProbeFailed(failure)
        if status is not None:
            self._hiccups.settle(status)
        if status is not None and status.cycle != self._cycle:
            self._cycle = status.cycle
            self._watch_current([reading for reading in status.servos if isinstance(reading, ServoState)])
        self._robot.send(self._command)

    def ticks(self) -> tuple[int, ...]:
        """Position registers of the seven, as they told last."""
        until_s = time.monotonic() + 1.0
        while time.monotonic() < until_s:
            status = self._robot.bus_status()
            readings = () if status is None else status.servos
            if len(readings) == len(self._joints) and all(isinstance(reading, ServoState) for reading in readings):
                return tuple(reading.ticks for reading in readings if isinstance(reading, ServoState))
            self.alive()
            self._stop.sleep(_PERIOD_S)
        raise ServoError("not all servos tell where they are: check cables and supply")

    def _watch_current(self, states: list[ServoState]) -> None:
        strained = [state for state in states if state.current_ma is not None and abs(state.current_ma) > self._most_ma]
        self._strained = self._strained + 1 if strained else 0
        if self._strained >= _STRAINED_CYCLES:
            self._robot.hold()
            self._robot.torque_off()
            names = ", ".join(f"{state.name} ({abs(state.current_ma or 0.0):.0f} mA)" for state in strained)
            raise Strained(f"too much current: {names}; the servos were let go: something holds the wires")


def _mean(images: list[Image]) -> Image:
    return np.asarray(np.round(np.mean(np.array(images, np.float32), axis=0)), np.uint8)

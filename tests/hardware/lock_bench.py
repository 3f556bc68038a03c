"""A twin whose servos, gate and camera turn on one clock: the wizard's procedures with the truth at hand, and no time of day."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

import numpy as np

from core.calibration.servos import Look
from core.config.models import Config
from core.config.safety import JointKind, SafetyConfig, ServosConfig
from core.control.gate import Source
from core.perception.pipeline import Pipeline, open_pipeline
from core.types import Command, Points
from hardware.calibration.servo_probe import ProbeLimits, StopSwitch, probe_config
from hardware.twin.actuation import JointsToTwin
from hardware.twin.process import wired
from hardware.twin.world import TwinWorld
from tools.lockstep import LockStepServos

_CYCLE_S = 0.02
_FRAMES = 4
_FRAME_S = 0.05


class LockTwin:
    """The world, and where its servos stand (mm in each servo's own positive direction, by id)."""

    def __init__(self, config: Config, insertion_mm: float = 70.0) -> None:
        self.config = config
        self.world = TwinWorld(config.twin, perception=config.perception, servos=config.servos, safety=config.safety)
        self.world.insert(insertion_mm)
        self.wiring = wired(config.twin, config.servos)
        self.turned_mm = {joint.id: 0.0 for joint in self.wiring.joints}
        self.time_s = 0.0
        self.moved: list[tuple[int, float]] = []
        """Every move of a servo: its id, and how far (mm) from where the twin was mounted."""
        self._link = JointsToTwin(self.wiring, self.joints_mm(), config.twin.roll_deg)
        self.world.drive = lambda duration_s: self._link.command(self.joints_mm(), duration_s)

    def joints_mm(self) -> tuple[float, ...]:
        """Where the joints really are; positive tightens, or feeds forward."""
        return tuple(joint.sign * self.turned_mm[joint.id] for joint in self.wiring.joints)

    def turn(self, servo_id: int, to_mm: float) -> None:
        self.turned_mm[servo_id] = to_mm
        self.moved.append((servo_id, to_mm))

    def pass_time(self, seconds: float) -> None:
        self.time_s += seconds
        self.world.advance(seconds)

    def head_px(self) -> Points:
        """The true head in the picture."""
        return np.asarray(self.world.view.project(np.array([self.world.physics.head_mm]))[0])


class _Mover:
    """Servos behind the gate on the twin's clock; `ids` are those of the joints, in their order."""

    def __init__(self, twin: LockTwin, servos: ServosConfig, stop: StopSwitch) -> None:
        self._twin, self._config, self._stop = twin, servos, stop
        self._at_mount = {joint.id: twin.turned_mm[joint.id] for joint in servos.joints}
        self._servos = LockStepServos(servos, SafetyConfig(), lambda: twin.time_s)
        self._servos.arm()
        self._command = Command()

    def cycle(self) -> None:
        self._stop.check()
        self._servos.beat(Source.OPERATOR)
        self._servos.send(self._command)
        self._servos.cycle()
        for joint, at_mm in zip(self._config.joints, self._servos.positions_mm(), strict=True):
            turned_mm = self._at_mount[joint.id] + joint.sign * at_mm
            if turned_mm != self._twin.turned_mm[joint.id]:
                self._twin.turn(joint.id, turned_mm)
        self._twin.pass_time(_CYCLE_S)

    def pause(self, seconds: float) -> None:
        for _ in range(round(seconds / _CYCLE_S)):
            self.cycle()

    def alive(self) -> None:
        self._stop.check()


class LockProbe(_Mover):
    @property
    def position_mm(self) -> float:
        return sum(self._servos.positions_mm()[self._config.places(JointKind.ADVANCE)])

    def move_to(self, target_mm: float) -> None:
        for _ in range(1000):
            left_mm = target_mm - self.position_mm
            if abs(left_mm) < 0.01:
                break
            self._command = Command(advance_mm_s=float(np.clip(left_mm / _CYCLE_S, -4.0, 4.0)))
            self.cycle()
        self._command = Command()


class LockSteered(_Mover):
    def bend_to(self, command: Command) -> None:
        self._command = command
        self.pause(0.6)

    @property
    def rotation_deg(self) -> float:
        return sum(self._servos.positions_mm()[self._config.places(JointKind.ROTATION)])

    def ticks(self) -> tuple[int, ...]:
        return (0,) * len(self._config.joints)


class LockBench:
    """A ``CalibrationBench`` on the twin's clock, which observes with the real network."""

    def __init__(self, twin: LockTwin) -> None:
        self._twin, self.stop = twin, StopSwitch()
        self._pipeline: Pipeline | None = None

    def observe(self, alive: Callable[[], None]) -> Look:
        if self._pipeline is None:
            plain = self._twin.config.perception.segmentation.model_copy(update={"mirrored": "never"})
            self._pipeline = open_pipeline(self._twin.config.perception.model_copy(update={"segmentation": plain}))
        paths, images = [], []
        for _ in range(_FRAMES):
            alive()
            self._twin.pass_time(_FRAME_S)
            frame = self._twin.world.frame()
            scene = self._pipeline.perceive_single(frame)
            images.append(frame.image)
            if scene.path is not None:
                paths.append(scene.points_to_source(scene.path.points))
        return Look(tuple(paths), np.round(np.mean(images, axis=0)).astype(np.uint8))

    @contextmanager
    def probe(
        self, servos: ServosConfig, servo_id: int, limits: ProbeLimits, sign: Literal[-1, 1], found: Mapping[int, int] | None = None
    ) -> Iterator[LockProbe]:
        yield LockProbe(self._twin, probe_config(servos, servo_id, limits, sign, found), self.stop)

    @contextmanager
    def steer(self, servos: ServosConfig) -> Iterator[LockSteered]:
        yield LockSteered(self._twin, servos, self.stop)


def lock_bench(config: Config) -> tuple[LockTwin, LockBench]:
    twin = LockTwin(config)
    return twin, LockBench(twin)

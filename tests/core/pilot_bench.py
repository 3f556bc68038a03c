"""A pilot with an obedient robot, a policy that always says the same and a clock that the test turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from core.config.models import Config
from core.control.bus_monitor import BusReport
from core.control.faults import Cause
from core.control.gate import Rejection, Source
from core.control.health import ModelReport
from core.control.joints import Retracted
from core.control.kept_zero import ZeroRequest
from core.control.modes import Act, Mode
from core.control.motion import AT_REST
from core.control.pilot import PERIOD_S, LeftOver, Pilot
from core.control.readiness import READY, Readiness
from core.control.robot import SentMotion
from core.devices import DeviceError
from core.types import Advice, Centerline, Command, Frame, Pose, PoseState, RobotPath, RobotStatus, Route, Scene, Speed

WELL = BusReport(
    misses=(0,) * 7, hardware_errors=(0,) * 7, temperatures_c=(30.0,) * 7, voltages_v=(12.0,) * 7, tracking_mm=(0.0,) * 7
)
PICTURE = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
ADVICE = Advice(Speed.SLOW, 2.0, 10.0, "go")


class Robot:
    """Does as it is told by the one who is permitted, and remembers."""

    name = "fake"

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.failure: str | None = None
        self.problem = ""
        self.retracts = Retracted.NONE
        self.bus: BusReport | None = WELL
        self.permitted: Source | None = None
        self.ordered: Source | None = None
        self.sent: list[tuple[Source, Command, float | None]] = []
        self.motion = SentMotion(0, 0.0, Command())
        self.keeps_back: Rejection | None = None
        self.edit: Callable[[SentMotion], SentMotion] = lambda motion: motion

    def connect(self) -> None:
        self.calls.append("connect")
        self.failure = None

    def send(
        self,
        command: Command,
        *,
        source: Source = Source.OPERATOR,
        captured_s: float | None = None,
        retracts: Retracted = Retracted.NONE,
    ) -> Command:
        self.retracts = retracts
        if self.failure is not None:
            raise DeviceError(self.failure)
        self.ordered = source
        self.sent.append((source, command, captured_s))
        self.motion = self.edit(SentMotion(self.motion.cycle + 1, (captured_s or 0.0) + 0.08, command, source, captured_s))
        return command

    def hold(self) -> None:
        self.ordered = None
        still = replace(self.motion.motion, advance_mm_s=0.0, delivery_mm_s=0.0)
        self.motion = SentMotion(self.motion.cycle + 1, 0.0, still)

    def beat(self, permitted: Source | None) -> None:
        assert self.ordered in {None, permitted}, "a command of a source that may not drive"
        self.permitted = permitted

    def stop(self) -> None:
        self.calls.append("stop")

    def arm(self) -> None:
        self.calls.append("arm")
        if self.problem:
            raise DeviceError(self.problem)

    def disarm(self) -> None:
        self.calls.append("disarm")

    def acknowledge(self) -> None:
        self.calls.append("acknowledge")

    def zero(self, request: ZeroRequest | None = None) -> None:
        self.calls.append("zero")

    def reboot(self, servo_id: int) -> None:
        self.calls.append(f"reboot {servo_id}")

    def torque_off(self) -> None:
        self.calls.append("torque off")

    def report(self) -> BusReport | None:
        return self.bus

    def sent_motion(self) -> SentMotion | None:
        return self.motion if self.keeps_back is None else None

    def kept_back(self) -> Rejection | None:
        return self.keeps_back

    def status(self) -> RobotStatus:
        return RobotStatus(0.0, 10.0, 0.0, (0.0,) * 4, (0.0,) * 4)

    def close(self) -> None: ...


class Policy:
    """Gives always the same advice where there is a pose."""

    def __init__(self) -> None:
        self.resets = 0

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        return ADVICE if scene.pose is not None else None

    def reset(self) -> None:
        self.resets += 1


def scene_at(index: int, captured_s: float, *, left_px: float = 200.0, route: bool = True) -> Scene:
    """A robot that lies on the middle of a straight vessel and looks along it."""
    line = np.column_stack([np.arange(100.0, 300.0), np.full(200, 60.0)])
    way = np.column_stack([np.arange(200.0, 200.0 + max(2.0, left_px)), np.full(int(max(2.0, left_px)), 60.0)])
    return Scene(
        index,
        captured_s,
        (640, 480),
        1.0,
        path=RobotPath(line[:101], 0.9, None, True, 0.0, 4.0),
        centerline=Centerline(line[80:120], (200.0, 60.0), 20.0),
        pose=Pose(1.0, 1.0, 0.0, 0.0, False, PoseState.A, 0.95),
        route=Route(way, left_px, (400.0, 60.0)) if route else None,
    )


class Bench:
    """Turns the pilot with a frame every second turn; `scene` changes what is understood."""

    def __init__(self, config: Config | None = None, left_over: LeftOver | None = None, readiness: Readiness = READY) -> None:
        self.now_s, self.index = 100.0, 0
        self.robot, self.policy = Robot(), Policy()
        self.scene: Callable[[Scene], Scene] = lambda scene: scene
        self.held = False
        self.jog = AT_REST
        self.seeing = True
        config = config or Config()
        self.pilot = Pilot(self.robot, self.policy, config, ModelReport(True), lambda: self.now_s, left_over, readiness)
        self.shown: Advice | None = None

    def turn(self, count: int = 1) -> Bench:
        for _ in range(count):
            self.now_s += PERIOD_S
            self.index += 1
            if self.index % 2 and self.seeing:
                image = PICTURE.copy()
                image[0, 0] = self.index % 251  # the camera stands still, and is not frozen
                frame = Frame(self.index, self.now_s - 0.03, image)
                self.pilot.frame_arrived(frame)
                scene = self.scene(scene_at(self.index, frame.captured_s))
                self.shown = self.pilot.update_scene(frame, scene, None, has_target=scene.route is not None)
            self.pilot.window_alive()
            self.pilot.perception_alive()
            self.pilot.deadman("key", self.held)
            if not self.jog.is_rest:
                self.pilot.jog("keys", self.jog)
            self.pilot.tick()
        return self

    def seconds(self, seconds: float) -> Bench:
        return self.turn(round(seconds / PERIOD_S))

    def done(self) -> Bench:
        """Wait for what the servos are doing."""
        self.pilot._requests._worker.submit(lambda: None).result(5.0)
        return self

    def on(self) -> Bench:
        self.seconds(0.2).done().pilot.switch_on()  # which is refused while something else is under way
        return self.done().seconds(1.2)

    def armed(self) -> Bench:
        self.on().pilot.ask(Act.ARM)
        return self.turn()

    def handed_over(self) -> Bench:
        self.armed().held = True
        self.turn(2).pilot.ask(Act.HAND_OVER)
        return self.turn(2)

    @property
    def mode(self) -> Mode:
        return self.pilot.view.mode

    @property
    def latched(self) -> Cause | None:
        return self.pilot.view.latched.cause if self.pilot.view.latched is not None else None

    def alerts(self) -> set[object]:
        return {alert.key for alert in self.pilot.news().alerts}

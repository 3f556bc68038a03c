"""A bench on which all is well, tick by tick: what the supervisor's tests start from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from core.config.safety import SafetyConfig, ServosConfig
from core.control.bus_monitor import BusReport
from core.control.camera_monitor import FrameReport, RouteState
from core.control.health import Beat, DeadmanReport, ModelReport, Part, ServoCheckReport
from core.control.modes import Act, Decision, Event, Mode, SupervisorState
from core.control.supervisor import supervise

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
TICK_S = 0.03125  # a power of two: sums are exact

GOOD_BUS = BusReport(
    misses=(0,) * 7, hardware_errors=(0,) * 7, temperatures_c=(40.0,) * 7, voltages_v=(12.0,) * 7, tracking_mm=(0.1,) * 7
)


class Bench:
    """Sends healthy reports every tick; `frame` and `bus` change what they say, `mute` leaves some kinds out."""

    def __init__(self) -> None:
        self.now_s = 64.0
        self.index = 0
        self.state = SupervisorState()
        self.held = False
        self.frame: Callable[[FrameReport], FrameReport] = lambda report: report
        self.bus = GOOD_BUS
        self.mute: set[type] = set()
        self.decision: Decision | None = None

    def reports(self) -> list[Event]:
        self.index += 1
        report = FrameReport(self.index, self.now_s - 0.015625, confidence=0.9, route=RouteState.READY)
        found: list[Event] = [self.frame(report), self.bus, Beat(Part.WINDOW), Beat(Part.PERCEPTION), DeadmanReport(self.held)]
        return [event for event in found if type(event) not in self.mute]

    def tick(self, *events: Event, after_s: float = TICK_S) -> Decision:
        """The healthy reports of one tick, then `events`."""
        self.now_s += after_s
        return self.raw([*self.reports(), *events], self.now_s)

    def raw(self, events: Sequence[Event], now_s: float) -> Decision:
        self.state, decision = supervise(self.state, events, now_s, SERVOS, SAFETY)
        self.decision = decision
        return decision

    def run(self, seconds: float, *events: Event) -> list[Decision]:
        """Ticks of the given length in total, each with `events`."""
        return [self.tick(*events) for _ in range(round(seconds / TICK_S))]

    def in_mode(self, mode: Mode) -> Bench:
        """Bring a fresh bench into `mode` the way an operator would."""
        self.tick(ModelReport(True), ServoCheckReport())
        self.run(1.0625)
        if mode is Mode.STOPPED:
            self.tick(Act.STOP)
            self.tick(ServoCheckReport())
        elif mode is not Mode.ADVISORY:
            self.tick(Act.ARM)
            if mode is not Mode.ARMED:
                self.held = True
                self.tick()
                self.tick(Act.HAND_OVER)
                if mode is Mode.HOLD:
                    self.held = False
                    self.tick()
        assert self.state.mode is mode, (self.state.mode, self.decision)
        return self

    def copy(self) -> Bench:
        twin = Bench()
        twin.__dict__.update(self.__dict__)
        twin.mute = set(self.mute)
        return twin

    def bad_frame(self, **changes: object) -> None:
        """From now on every frame report has these `changes`."""
        self.frame = lambda report: replace(report, **changes)

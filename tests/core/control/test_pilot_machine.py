"""The pilot under random sequences of what operator, deadmen, perception, servos and time can do.

The model beside it knows only the rules: who may drive when, from where, and what has to happen before anything moves again. What
happens is drawn by weight, so that half of it happens on the way to autonomy or in it; a failure tells what was done last.
"""

import math
import random
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace

import pytest

from core.control.gate import Source
from core.control.modes import Act, Mode
from core.control.motion import AT_REST, Jog
from core.control.pilot import PERIOD_S
from core.types import Advice, Command, Frame, Reason, Refusal, RobotStatus, Scene, Speed
from tests.core.pilot_bench import ADVICE, PICTURE, WELL, Bench, Robot, scene_at

HELD_S = 0.1
"""No program's order later than this after the last word of a held deadman."""
MOST_MM_S = 20.0
MOST_BEND_PER_S, LONGEST_STEP_S = 1.5, 0.1
"""Of both drivers; a longer pause between two turns counts as so much."""
CLOSE = 1e-9

SCENES: dict[str, Callable[[Scene], Scene]] = {
    "well": lambda scene: scene,
    "no robot": lambda scene: replace(scene, pose=None, refusal=Refusal(Reason.NO_ROBOT), route=None),
    "several": lambda scene: replace(scene, pose=None, refusal=Refusal(Reason.SEVERAL_ROBOTS), route=None),
    "doubtful": lambda scene: replace(scene, pose=replace(scene.pose, confidence=0.1) if scene.pose is not None else None),
    "not finite": lambda scene: replace(scene, pose=replace(scene.pose, theta_deg=math.nan) if scene.pose is not None else None),
    "no way": lambda scene: replace(scene, route=None),
    "arrived": lambda scene: scene_at(scene.frame_index, scene.captured_s, left_px=5.0),
}
ADVICES = (
    ADVICE,
    Advice(Speed.SLOWEST, -3.0, -30.0, "back"),
    Advice(Speed.FAST, MOST_MM_S, 170.0, "fast"),
    Advice(Speed.SLOW, 2.0, math.nan, "broken"),
    Advice(Speed.SLOW, math.nan, 10.0, "broken"),
    Advice(Speed.SLOW, math.inf, -math.inf, "broken"),
)
FAULTS = {
    "alert": replace(WELL, hardware_errors=(0, 0, 32, 0, 0, 0, 0)),
    "silent servo": replace(WELL, misses=(0, 3, 0, 0, 0, 0, 0)),
    "restarted": replace(WELL, rebooted=True),
    "hot": replace(WELL, temperatures_c=(30.0, 90.0, 30.0, 30.0, 30.0, 30.0, 30.0)),
    "port lost": replace(WELL, port_open=False),
    "quiet bus": None,
}
RATES = (0.0, 0.0, 0.3, 1.0, -1.0, math.nan, math.inf)


class WatchedRobot(Robot):
    """Refuses to be armed or driven between a STOP and what has to come before the next motion."""

    def __init__(self) -> None:
        super().__init__()
        self.locked = False
        self.offences: list[str] = []
        self.meanwhile: dict[str, Callable[[], None]] = {}

    def disarm(self) -> None:
        super().disarm()
        self._happens("disarm")

    def acknowledge(self) -> None:
        super().acknowledge()
        self._happens("acknowledge")

    def arm(self) -> None:
        if self.locked:  # in the requests' thread: the machine asks for it later
            self.offences.append("the servos are switched on again after a STOP without an acknowledgement")
        super().arm()
        self._happens("arm")

    def _happens(self, call: str) -> None:
        """What else goes on while a request takes its time, once."""
        if (action := self.meanwhile.pop(call, None)) is not None:
            action()


class ChosenPolicy:
    """Gives the advice that the machine chose, without a pose none."""

    advice = ADVICE
    given: Advice | None = None

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        self.given = self.advice if scene.pose is not None else None
        return self.given

    def reset(self) -> None: ...


class PilotMachine:
    """Turns a pilot, does things to it in between, and checks every order that leaves."""

    def __init__(self, seed: int) -> None:
        self.draw = random.Random(seed)
        self.done: deque[str] = deque(maxlen=20)
        self.counts: Counter[str] = Counter()
        self.bench = Bench()
        self.robot = WatchedRobot()
        self.policy = ChosenPolicy()
        pilot = self.bench.pilot
        self.bench.robot = pilot._robot = pilot._requests._robot = self.robot
        pilot._policy = self.policy
        self.jogs: dict[str, Jog] = {}
        self.touched = False
        self.talking: set[str] = set()
        self.deadmen: dict[str, bool] = {}
        self.unsure: set[str] = set()
        self.said_s: dict[str, float] = {}
        self.pressed_s: dict[str, float] = {}
        self.is_on = self.handed_over = False
        self.stops_meanwhile = 0
        self.armed_s = math.inf
        self.driver: Source | None = None
        self.ticked_s = self.bench.now_s

    def run(self, steps: int) -> None:
        anything: tuple[tuple[Callable[[], None], int], ...] = (
            (self.time_passes, 6),
            (self.nobody_turns, 2),
            (self.nothing_is_heard, 2),
            (self.operator_asks, 5),
            (self.stop, 1),
            (self.switch_on, 3),
            (self.let_go_of_servos, 1),
            (self.jog, 4),
            (self.let_go, 3),
            (self.touch, 1),
            (self.deadman, 4),
            (self.a_deadman_falls_silent, 1),
            (self.a_deadman_cannot_tell, 2),
            (self.perception, 4),
            (self.servos_fail, 1),
            (self.servos_recover, 2),
            (self.the_check_fails, 1),
            (self.the_bus_process_dies, 1),
        )
        actions, weights = zip(*anything, strict=True)
        for _ in range(steps):
            lost = self.bench.mode in {Mode.ADVISORY, Mode.STOPPED} and self.draw.random() < 0.4
            action = self.the_way_to_autonomy if lost else self.draw.choices(actions, weights)[0]
            self.done.append(action.__name__)
            action()
            assert self.robot.offences == []

    def close(self) -> None:
        self.bench.pilot.close()
        assert self.robot.permitted is None

    # ---- what happens

    def time_passes(self, count: int | None = None) -> None:
        for _ in range(count if count is not None else self.draw.randint(1, 8)):
            self._turn()

    def nobody_turns(self) -> None:
        self.bench.now_s += self.draw.choice((0.05, 0.05, 0.12, 0.3, 0.7, 1.5))
        self._turn()

    def nothing_is_heard(self) -> None:
        """Window and devices are silent, and the pilot turns."""
        for _ in range(self.draw.randint(3, 8)):
            self._turn(silent=True)

    def operator_asks(self) -> None:
        acts = (Act.ARM, Act.HAND_OVER, Act.HAND_OVER, Act.TAKE_BACK, Act.DISARM, Act.ACKNOWLEDGE)
        self._ask(self.draw.choice(acts))
        self.bench.done()
        self._turn()

    def stop(self) -> None:
        self._ask(Act.STOP)
        if self.draw.random() < 0.5:
            self._turn()

    def switch_on(self) -> None:
        """Also with a STOP, or turns of the pilot, in the middle of it."""
        happens = self.draw.choice((None, self._turn, lambda: self._ask(Act.STOP), self._stop_and_acknowledge))
        if happens is not None:
            self.robot.meanwhile = {self.draw.choice(("disarm", "acknowledge", "arm")): happens}
        self._switch_on()

    def let_go_of_servos(self) -> None:
        pilot = self.bench.pilot
        before = len(self.robot.calls)
        self.draw.choice((pilot.zero, pilot.torque_off, lambda: pilot.reboot(3)))()
        self.bench.done()
        if "disarm" in self.robot.calls[before:]:  # refused while armed, some also while a fault waits
            self.is_on = False
        self._turn()

    def the_way_to_autonomy(self) -> None:
        """What a careful operator does, or nearly; it must not lead there when the deadman was down before arming."""
        self.policy.advice, self.robot.bus, self.robot.failure, self.robot.problem = ADVICE, WELL, None, ""
        self.bench.scene, self.bench.seeing, self.jogs = SCENES["well"], True, {}
        self._ask(Act.ACKNOWLEDGE)
        self.bench.done()
        self._turn()
        self._switch_on()
        early = self.draw.random() < 0.3
        for source in ("key", "pedal"):
            self._say(source, False)
            self._say(source, early and source == "pedal")
        self._drive_by_hand()
        self.time_passes(55)
        self._ask(Act.ARM)
        self._turn()
        if early:
            self.draw.choice((self.nothing_is_heard, self._turn))()
        else:
            self._say("key", True)
        self.time_passes(2)
        self._ask(Act.HAND_OVER)
        self.time_passes(3)

    def jog(self) -> None:
        bend, pitch, advance = (self.draw.choice(RATES) for _ in range(3))
        self.jogs[self.draw.choice(("keys", "pad"))] = Jog(bend, pitch, advance, 0.0, self.draw.random() < 0.2)
        self._turn()

    def let_go(self) -> None:
        self.jogs = dict.fromkeys(self.jogs, AT_REST)
        self._turn()
        self.jogs = {}

    def touch(self) -> None:
        """Shorter than a turn."""
        self.bench.pilot.jog("keys", Jog(advance=0.5))
        self.bench.pilot.jog("keys", AT_REST)
        self.touched = True
        self._turn()

    def deadman(self) -> None:
        self._say(self.draw.choice(("key", "pedal")), self.draw.random() < 0.6)
        self._turn()

    def a_deadman_falls_silent(self) -> None:
        self.talking.discard(self.draw.choice(("key", "pedal")))
        self.time_passes()

    def a_deadman_cannot_tell(self) -> None:
        """A damaged report in its place, which is no release; or its report is late, for a turn or some."""
        source = self.draw.choice(("key", "pedal"))
        speaks = source in self.talking
        self.talking.discard(source)
        if self.draw.random() < 0.5:
            self.unsure.add(source)
            self.bench.pilot.deadman(source, None)
        self.time_passes(self.draw.choice((1, 1, 2, 5)))
        if speaks:
            self._say(source, self.deadmen[source])

    def perception(self) -> None:
        kinds = ("well", "well", "well", *SCENES)
        self.bench.scene, self.policy.advice = SCENES[self.draw.choice(kinds)], self.draw.choice((ADVICE, ADVICE, *ADVICES))
        self.bench.seeing = self.draw.random() < 0.8
        self.time_passes(3)

    def servos_fail(self) -> None:
        self.robot.bus = self.draw.choice(list(FAULTS.values()))
        self.time_passes(2)

    def servos_recover(self) -> None:
        self.robot.bus, self.robot.problem = WELL, ""
        self._turn()

    def the_check_fails(self) -> None:
        self.robot.problem = "servo 3 does not answer"

    def the_bus_process_dies(self) -> None:
        if self.robot.failure is None:
            self.robot.failure = "the servo bus process ended"
            self.is_on = False
            self._turn()

    def _switch_on(self) -> None:
        counts = not self.robot.locked and not self.robot.problem
        self.stops_meanwhile, before = 0, len(self.robot.calls)
        self.bench.pilot.switch_on()
        self.bench.done()
        self.robot.meanwhile = {}
        if "disarm" not in self.robot.calls[before:]:  # refused while armed, or while a fault waits
            return
        stopped = self.robot.locked or self.stops_meanwhile > 0
        self.is_on = (self.is_on or counts) and not stopped and not self.robot.problem
        self._turn()

    def _stop_and_acknowledge(self) -> None:
        self._ask(Act.STOP)
        self._turn()
        self._ask(Act.ACKNOWLEDGE)

    def _drive_by_hand(self) -> None:
        """Leaves bend and pitch somewhere."""
        self.jogs = {"keys": Jog(self.draw.choice((-1.0, 0.0, 1.0)), self.draw.choice((-1.0, 0.0, 1.0)))}
        self.time_passes()
        self.let_go()

    # ---- the rules

    def _ask(self, act: Act) -> None:
        if act is Act.STOP:
            self.is_on = False
            self.stops_meanwhile += 1
            self.robot.locked = True
            self.bench.pilot.stop()
            return
        if act is Act.ACKNOWLEDGE:
            self.robot.locked = False
        elif act is Act.HAND_OVER:
            self.handed_over = True
        self.bench.pilot.ask(act)

    def _say(self, source: str, pressed: bool) -> None:
        """A deadman's report; it is repeated until it falls silent. A press counts from a release that was said."""
        if not pressed:
            self.pressed_s.pop(source, None)
        elif self.deadmen.get(source) is False:
            self.pressed_s[source] = self.bench.now_s
        self.talking.add(source)
        self.unsure.discard(source)
        self.deadmen[source] = pressed
        self.said_s[source] = self.bench.now_s
        self.bench.pilot.deadman(source, pressed)

    def _turn(self, silent: bool = False) -> None:
        bench, pilot = self.bench, self.bench.pilot
        bench.now_s += PERIOD_S
        bench.index += 1
        if not silent:
            if bench.index % 2 and bench.seeing:
                self._frame()
            pilot.window_alive()
            pilot.perception_alive()
            for source in sorted(self.talking):
                self._say(source, self.deadmen[source])
            for source, jog in self.jogs.items():
                pilot.jog(source, jog)
                self.touched = self.touched or not jog.is_rest
        self._tick()

    def _frame(self) -> None:
        bench = self.bench
        scene = bench.scene(scene_at(bench.index, bench.now_s - 0.03))
        pixels = PICTURE.copy()
        pixels[0, 0] = bench.index % 251
        frame = Frame(bench.index, scene.captured_s, pixels)
        bench.pilot.frame_arrived(frame)
        bench.pilot.update_scene(frame, scene, None, has_target=scene.route is not None)

    def _tick(self) -> None:
        robot, before = self.robot, self.robot.motion.motion
        count, mode_before = len(robot.sent), self.bench.mode
        view = self.bench.pilot.tick()
        touched, self.touched = self.touched, False
        sent = robot.sent[count:]
        assert len(sent) <= 1
        for source, command, _ in sent:
            self._check_order(source, command, before, touched=touched)
        self.ticked_s = self.bench.now_s
        self.driver = robot.permitted
        if view.mode is Mode.STOPPED:
            robot.locked = robot.locked or mode_before is not Mode.STOPPED
            self.is_on = False
        self.counts[view.mode.value] += 1
        self._check_mode(view.mode, mode_before)

    def _check_order(self, source: Source, command: Command, before: Command, *, touched: bool) -> None:
        now_s = self.bench.now_s
        numbers = (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s)
        assert all(math.isfinite(number) for number in numbers), command
        assert abs(command.bend) <= 1.0 and abs(command.pitch) <= 1.0, command
        assert abs(command.advance_mm_s) <= MOST_MM_S and abs(command.delivery_mm_s) <= MOST_MM_S, command
        assert self.is_on, "an order although the servos were not switched on since the last STOP, fault or request"
        assert source is self.robot.permitted
        if source is not self.driver:
            assert (command.bend, command.pitch) == (before.bend, before.pitch), "the first order moves the head"
        reach = MOST_BEND_PER_S * min(now_s - self.ticked_s, LONGEST_STEP_S) + CLOSE
        assert abs(command.bend - before.bend) <= reach and abs(command.pitch - before.pitch) <= reach, "the head jumps"
        if source is Source.PROGRAM:
            assert not touched, "the operator's input wins in the same turn"
            held = [source for source, at_s in self.pressed_s.items() if at_s >= self.armed_s - CLOSE and source not in self.unsure]
            ages_s = [now_s - self.said_s[source] for source in held]
            assert min(ages_s, default=math.inf) <= HELD_S + CLOSE, "the program drives and the deadman is not held"
            advice = self.policy.given
            whole = advice is None or math.isfinite(advice.advance_mm_s + advice.steer_deg)
            assert whole or command.advance_mm_s == 0.0, "broken advice is driven"

    def _check_mode(self, mode: Mode, before: Mode) -> None:
        if mode in {Mode.ARMED, Mode.AUTONOMOUS} and before not in {Mode.ARMED, Mode.AUTONOMOUS, Mode.HOLD}:
            self.armed_s = self.bench.now_s
        if mode in {Mode.ADVISORY, Mode.STOPPED}:
            self.handed_over = False
            self.armed_s = math.inf
        if mode is Mode.AUTONOMOUS:
            assert self.handed_over, "autonomous without a hand-over"
            assert any(at_s >= self.armed_s - CLOSE for at_s in self.pressed_s.values()), "a deadman that was down before arming"

        if mode in {Mode.STOPPED, Mode.HOLD}:
            assert self.robot.permitted is None


@pytest.mark.parametrize("seed", range(4))
def test_nothing_unsafe_leaves_whatever_happens(seed: int) -> None:
    machine = PilotMachine(seed)
    try:
        machine.run(220)
    except AssertionError as error:
        error.add_note(f"done before: {', '.join(machine.done)}")
        raise
    finally:
        machine.close()
    assert machine.counts["AUTONOMOUS"] > 50, f"the sequences have to get into autonomy to say something: {machine.counts}"

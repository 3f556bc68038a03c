"""The bus process's loop with a bus and an application of paper: orders of events that are seldom on a real line."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from core.config.safety import SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault
from hardware.servos import bus_process, servo_robot
from hardware.servos.bus_ipc import BusStatus, Request
from hardware.servos.bus_process import BusLoop
from hardware.servos.dynamixel_port import LineCounts, NoAnswer, NotReady, ServoError, StoppedMeanwhile, TorqueStillOn
from hardware.servos.registers import HardwareError, MissingServo, ServoState
from hardware.servos.servo_robot import ServoRobot


class PaperBus:
    """Writes down what it is told."""

    is_open, is_armed, zero_ticks, identities = True, False, (0,) * 7, ()

    def __init__(self) -> None:
        self.counts = LineCounts()
        self.told: list[str] = []
        self.torque_stays = False
        self.missing = ""
        self.check: Callable[[], None] = lambda: None

    @contextlib.contextmanager
    def interruptible(self, check: Callable[[], None]) -> Iterator[None]:
        self.check = check
        yield

    def pause(self, seconds: float) -> None:
        self.check()

    def open(self) -> None:
        if self.missing:
            raise NoAnswer(self.missing)
        self.told.append("open")
        self.is_open = True

    def let_go(self) -> None:
        self.told.append("let go")
        raise TorqueStillOn("torque of up is not proven to be off: cut the servos' power")

    def disarm(self) -> None:
        self.told.append("hold")

    def hold(self) -> None:
        self.told.append("hold")

    def arm(self) -> None:
        self.told.append("arm")

    def slacken(self, goals_mm: tuple[float | None, ...], readings: object) -> None:
        self.told.append(f"slacken to {goals_mm[0]:.2f}" if goals_mm[0] is not None else "slacken")

    def read(self) -> tuple[MissingServo, ...]:
        return tuple(MissingServo(joint.name, joint.id, 0.0, 1, "silent") for joint in ServosConfig().joints)

    def set_zero(self, names: object) -> None:
        self.told.append("zero")

    def close(self) -> None:
        self.told.append("close")

    def torque_off(self) -> None:
        if self.torque_stays:
            raise TorqueStillOn("torque of right is not proven to be off: cut the servos' power")
        self.told.append("torque off")


class PaperEnd:
    """The application's side: what waits now."""

    is_alone = False
    told: BusStatus

    def __init__(self) -> None:
        self.stop = False
        self.waiting: Request | None = None
        self.answers: list[tuple[str, ServoError | None]] = []
        self.words: list[str] = []

    def wait(self, timeout_s: float) -> tuple[bool, bool]:
        return self.stop, self.waiting is not None

    def read_stop(self) -> bool:
        taken, self.stop = self.stop, False
        return taken

    def read_request(self) -> Request | None:
        taken, self.waiting = self.waiting, None
        return taken

    def heartbeat(self) -> None:
        """None has come."""

    def publish(self, status: BusStatus) -> None:
        self.told = status

    def send_fatal(self, text: str) -> None:
        self.words.append(text)

    def send_stay(self) -> None:
        self.words.append("stays")

    def answer(self, request: Request, error: ServoError | None) -> None:
        self.answers.append((request.what, error))


class Paper:
    """Loop, bus and application, with a clock that the test turns."""

    temperature_c, tendon_mm = 30.0, 0.0
    missing: int | None = None
    """Place of a servo that does not answer."""
    feed_goal_mm = 0.0
    """How far the goal of the robot's feed is from where it is."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **servos: bool) -> None:
        self.now_s = 100.0
        monkeypatch.setattr(bus_process.time, "monotonic", lambda: self.now_s)
        self.bus, self.end = PaperBus(), PaperEnd()
        self.loop = BusLoop(self.end, self.bus, ServosConfig(**servos), SafetyConfig())

    def hear(self, *, stop: bool = False, request: str | None = None) -> None:
        self.end.stop = stop
        self.end.waiting = Request(1, request) if request is not None else None
        self.loop._listen_until(self.now_s)

    def turn(self) -> None:
        """A cycle in which the servos say nothing new."""
        self.now_s += 0.02
        self.loop._guard.update = lambda *_: None
        self.end.heartbeat = lambda: None
        self.loop._read_decide_write()

    def reads(self, advance_mm: float = 0.0, tendon_mm: float = 0.0) -> None:
        """From now on all servos tell that they hold at zero, but for one or two."""
        self.tendon_mm = tendon_mm
        places = zip(ServosConfig().joints, (tendon_mm, 0.0, 0.0, 0.0, advance_mm, 0.0, 0.0), strict=True)
        hot_c = self.temperature_c
        goals = {"advance": round(102.4 * self.feed_goal_mm)}
        states = tuple(
            MissingServo(joint.name, joint.id, self.now_s, 1, "silent")
            if place == self.missing
            else ServoState(
                joint.name, joint.id, self.now_s, 0, goals.get(joint.name, 0), at_mm, at_mm, 0.0, 8.0, 12.0, hot_c,
                HardwareError(0), torque=True, watchdog_tripped=False,
            )
            for place, (joint, at_mm) in enumerate(places)
        )  # fmt: skip
        self.bus.read = lambda: states
        self.end.heartbeat = lambda: None

    @property
    def stopped(self) -> bool:
        return self.loop._guard.stopped

    @property
    def latched(self) -> Fault | None:
        return self.loop._guard.latched


@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch) -> Iterator[Paper]:
    yield Paper(monkeypatch)


def test_a_stop_that_is_said_again_and_again_holds_once(paper: Paper) -> None:
    """A broken wire of the pedal; each hold under load would let a tendon creep."""
    for _ in range(200):
        paper.hear(stop=True)
        paper.now_s += 0.02
    assert paper.bus.told == ["hold"]
    assert paper.stopped


def test_a_stop_after_its_acknowledgement_is_a_new_one(paper: Paper) -> None:
    paper.hear(stop=True)
    paper.now_s += 0.1
    paper.hear(request="acknowledge")
    assert not paper.stopped
    paper.now_s += 0.1
    paper.hear(stop=True)
    assert paper.stopped
    assert paper.bus.told == ["hold", "hold"]


def test_an_acknowledgement_that_was_asked_for_before_stop_does_not_undo_it(paper: Paper) -> None:
    paper.hear(stop=True, request="acknowledge")
    assert paper.stopped
    assert paper.latched is not None
    what, error = paper.end.answers[0]
    assert what == "acknowledge"
    assert isinstance(error, NotReady)
    assert "STOP was pressed meanwhile" in str(error)
    paper.now_s += 0.02
    paper.hear(request="acknowledge")
    assert not paper.stopped


def test_stop_between_two_transactions_of_arming_is_told_at_once_and_the_servos_are_held(paper: Paper) -> None:
    """It was heard when all servos had been switched on."""

    def arm() -> None:
        paper.bus.check()
        paper.end.stop = True
        assert not paper.stopped
        with pytest.raises(StoppedMeanwhile):
            paper.bus.check()
        assert paper.end.told.latched == Fault(Cause.STOP_PRESSED)
        paper.bus.told.append("undone")
        raise StoppedMeanwhile("stopped meanwhile: acknowledge, then switch the servos on again")

    paper.bus.arm = arm
    paper.reads()
    paper.hear(request="arm")
    assert paper.bus.told == ["undone", "hold"]
    assert paper.stopped
    assert not paper.loop._guard.armed
    assert "stopped meanwhile: acknowledge" in str(paper.end.answers[0][1])
    paper.hear(request="arm")
    assert "acknowledge first: stop pressed" in str(paper.end.answers[1][1])


def test_stop_in_the_middle_of_arming_releases_the_wires_where_that_is_the_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    paper = Paper(monkeypatch, torque_off_on_stop=True)

    def arm() -> None:
        paper.end.stop = True
        paper.bus.check()

    paper.bus.arm = arm
    paper.reads()
    paper.hear(request="arm")
    assert paper.bus.told == ["hold", "torque off"]


def test_servos_are_not_switched_on_for_an_application_that_has_gone(paper: Paper) -> None:
    def arm() -> None:
        paper.end.is_alone = True
        paper.bus.check()
        raise AssertionError("it went on")

    paper.bus.arm = arm
    paper.reads()
    paper.hear(request="arm")
    assert "the application ended meanwhile" in str(paper.end.answers[0][1])


def _follow(paper: Paper, cycles: int) -> None:
    """The right servo goes where it is sent."""
    for _ in range(cycles):
        paper.now_s += 0.02
        at_mm = float(paper.bus.told[-1].split()[-1]) if paper.bus.told[-1].startswith("slacken to") else paper.tendon_mm
        paper.reads(tendon_mm=at_mm)
        paper.loop._read_decide_write()


def test_wires_that_are_to_be_relaxed_are_let_out_slowly_and_then_let_go(paper: Paper) -> None:
    paper.reads(tendon_mm=2.0)
    paper.hear(request="relax")
    assert paper.end.answers == [("relax", None)]
    assert paper.end.told.releasing
    _follow(paper, 50)
    assert paper.bus.told[-1] == "slacken to 1.00"
    _follow(paper, 60)
    assert paper.bus.told[-2:] == ["hold", "torque off"]
    paper.loop._publish(paper.now_s)
    assert not paper.end.told.releasing
    assert paper.end.told.torque_offs == 1


def test_stop_ends_it_and_the_wires_stay_as_they_are(paper: Paper) -> None:
    paper.reads(tendon_mm=2.0)
    paper.hear(request="relax")
    _follow(paper, 20)
    paper.hear(stop=True)
    _follow(paper, 160)
    assert paper.bus.told[-1] == "hold"
    assert "torque off" not in paper.bus.told
    assert paper.stopped


def test_a_servo_that_does_not_answer_ends_neither_the_ramp_nor_the_process(paper: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(*_: object) -> None:
        raise NoAnswer("servo right (id 1): no answer")

    paper.reads(tendon_mm=2.0)
    paper.hear(request="relax")
    with monkeypatch.context() as patch:
        patch.setattr(paper.bus, "slacken", silent)
        _follow(paper, 20)
    assert paper.loop._ramp is not None
    _follow(paper, 30)
    assert paper.bus.told[-1] == "slacken to 1.00"


def test_a_port_that_is_lost_while_wires_are_relaxed_owes_the_torque_off(paper: Paper) -> None:
    paper.reads(tendon_mm=2.0)
    paper.hear(request="relax")
    _follow(paper, 20)
    paper.loop._lose_port()
    assert paper.loop._release.is_requested


def test_a_servo_that_is_missing_does_not_keep_the_others_tight(paper: Paper) -> None:
    """The wires stayed as they were, though the program said that they were let out."""
    paper.missing = 3  # down
    paper.reads(tendon_mm=2.0)
    paper.loop._read_decide_write()
    paper.loop._end_motion(Fault(Cause.STRAINED, "right"))
    _follow(paper, 25)
    assert paper.bus.told[-1] == "slacken to 1.00"
    _follow(paper, 80)
    paper.loop._publish(paper.now_s)
    assert not paper.end.told.releasing
    assert (paper.end.told.releases, paper.end.told.still_tight) == (1, ("down",))


@pytest.mark.parametrize("cause", [Cause.STRAINED, Cause.TRACKING, Cause.HOT])
def test_wires_are_let_out_after_these_faults_and_that_is_told(paper: Paper, cause: Cause) -> None:
    """A servo that is too hot held the wires, got hotter, and shut itself down with a snap."""
    paper.reads(tendon_mm=2.0)
    paper.loop._read_decide_write()
    paper.loop._end_motion(Fault(cause, "right"))
    paper.loop._publish(paper.now_s)
    assert paper.end.told.releases == 0
    _follow(paper, 110)
    paper.loop._publish(paper.now_s)
    assert (paper.end.told.releases, paper.end.told.still_tight) == (1, ())


def test_a_hold_that_was_lost_is_repeated_while_the_wires_are_let_out(paper: Paper) -> None:
    """The feed went on to its last goal meanwhile."""
    paper.reads(tendon_mm=2.0)
    paper.loop._read_decide_write()
    paper.loop._end_motion(Fault(Cause.STRAINED, "right"))
    paper.feed_goal_mm = 0.9
    told = len(paper.bus.told)
    _follow(paper, 3)
    assert paper.bus.told[told:] == ["hold", "slacken to 1.96", "hold", "slacken to 1.92", "hold", "slacken to 1.88"]
    paper.feed_goal_mm = 0.0
    _follow(paper, 2)
    assert "hold" not in paper.bus.told[-2:]


def test_where_the_pull_is_not_known_the_torque_goes_off_at_once(paper: Paper) -> None:
    paper.hear(request="relax")
    paper.turn()
    assert paper.bus.told == ["hold", "torque off"]


@pytest.mark.parametrize("request_", ["arm", "zero", "reboot"])
def test_nothing_else_is_begun_while_the_wires_are_let_out(paper: Paper, request_: str) -> None:
    paper.reads(tendon_mm=2.0)
    paper.hear(request="relax")
    paper.hear(request=request_)
    assert "the tension is being let off: wait" in str(paper.end.answers[1][1])


def test_a_torque_off_does_not_wait_for_it(paper: Paper) -> None:
    paper.reads(tendon_mm=2.0)
    paper.hear(request="relax")
    paper.hear(request="torque off")
    assert paper.bus.told[-1] == "torque off"
    _follow(paper, 5)
    assert paper.bus.told[-1] == "torque off"


def test_a_strained_servo_is_relaxed_before_the_torque_goes_off_by_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    paper = Paper(monkeypatch, torque_off_on_stop=True)
    paper.reads(tendon_mm=2.0)
    paper.loop._read_decide_write()
    paper.loop._end_motion(Fault(Cause.STRAINED, "right"))
    _follow(paper, 70)
    assert paper.bus.told[0] == "hold"
    assert "slacken to 1.00" in paper.bus.told
    assert paper.bus.told[-1] == "torque off"


def test_servos_that_hold_and_are_too_hot_are_relaxed_once_and_again_when_it_gets_worse(paper: Paper) -> None:
    paper.temperature_c = 69.0
    paper.reads(tendon_mm=2.0)
    paper.loop._read_decide_write()
    assert paper.bus.told == []
    paper.bus.told.append("hot")
    paper.temperature_c = 70.0
    _follow(paper, 20)
    assert paper.bus.told[-1] == "slacken to 1.24"
    paper.hear(stop=True)
    paper.tendon_mm = 1.24
    _follow(paper, 20)
    assert paper.bus.told[-1] == "hold"
    paper.temperature_c = 72.0
    _follow(paper, 60)
    assert paper.bus.told[-2].startswith("slacken to 0.0")
    assert "torque off" not in paper.bus.told


@pytest.mark.parametrize("loses", ["nothing", "torque"])
def test_without_an_application_only_servos_that_pull_are_watched(
    paper: Paper, monkeypatch: pytest.MonkeyPatch, loses: str
) -> None:
    class PaperSuccession:
        def __init__(self, port: str) -> None:
            paper.bus.told.append("watches")

        def wait(self, timeout_s: float) -> bool:
            paper.now_s += max(0.0, timeout_s)
            return False

        def close(self) -> None:
            paper.bus.told.append("leaves")

    monkeypatch.setattr(bus_process, "PortSuccession", PaperSuccession)
    paper.loop._servos = paper.loop._servos.model_copy(update={"port": "/dev/none", "unattended_s": 60.0})
    paper.reads(tendon_mm=2.0)
    if loses == "torque":
        states = tuple(replace(state, torque=False) for state in paper.bus.read())
        paper.bus.read = lambda: states
    paper.end.is_alone = True
    begun_s = paper.now_s
    paper.loop.run()
    told = [one for one in paper.bus.told if not one.startswith("slacken")]
    if loses == "torque":
        assert told == ["close"]
    else:
        assert told[:1] == ["watches"]
        assert told[-3:] == ["torque off", "close", "leaves"]
        assert 60.0 <= paper.now_s - begun_s <= 70.0
    assert ("stays" in paper.end.words) is (loses == "nothing")


def test_the_first_cause_stays_when_the_torque_cannot_be_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    paper = Paper(monkeypatch, torque_off_on_stop=True)
    paper.loop._guard.end_motion(Fault(Cause.SERVO_SILENT, "up"))
    paper.bus.torque_stays = True
    paper.hear(stop=True)
    assert paper.latched.cause is Cause.SERVO_SILENT
    assert "up" in paper.latched.detail
    assert "cut the servos' power" in paper.latched.detail


def test_a_torque_off_that_failed_is_tried_until_the_servos_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """One burst of noise takes all three packets, and STOP that is held for seconds counts as one."""
    paper = Paper(monkeypatch, torque_off_on_stop=True)
    paper.bus.torque_stays = True
    paper.hear(stop=True)
    for _ in range(10):
        paper.hear(stop=True)
        paper.turn()
    assert paper.latched.detail.count("cut the servos' power") == 1
    assert paper.bus.told == ["hold"], "no second hold, under which a tendon would creep"
    paper.bus.torque_stays = False
    for _ in range(3):
        paper.turn()
    assert paper.bus.told[:2] == ["hold", "torque off"]
    assert paper.bus.told.count("torque off") == 1
    assert "cut the servos' power" not in paper.latched.detail


def test_a_port_that_comes_back_owes_the_torque_off(monkeypatch: pytest.MonkeyPatch) -> None:
    paper = Paper(monkeypatch, torque_off_on_stop=True)
    paper.loop._lose_port()
    paper.turn()
    assert paper.bus.told == ["torque off"]


def _off_after(paper: Paper, tries: int) -> None:
    """The servos say so only after so many tries."""
    left = [tries]

    def torque_off() -> None:
        left[0] -= 1
        if left[0] >= 0:
            raise TorqueStillOn("torque of right is not proven to be off: cut the servos' power")
        paper.bus.told.append("torque off")

    paper.bus.torque_off = torque_off


@pytest.mark.parametrize("tries", [0, 1, 3])
def test_a_torque_off_that_is_asked_for_is_tried_again_before_it_is_answered(paper: Paper, tries: int) -> None:
    _off_after(paper, tries)
    paper.hear(request="torque off")
    assert paper.end.answers == [("torque off", None)]
    assert paper.bus.told == ["torque off"]


def test_a_torque_off_that_was_asked_for_in_vain_is_told_and_stays_owed(paper: Paper) -> None:
    """It was forgotten, and the wires stayed under tension although somebody had let them go."""
    _off_after(paper, 6)
    paper.hear(request="torque off")
    _, error = paper.end.answers[0]
    assert isinstance(error, TorqueStillOn)
    assert "cut the servos' power" in paper.end.told.torque_problem
    for _ in range(3):
        paper.turn()
    assert paper.bus.told == ["torque off"]
    paper.loop._publish(paper.now_s)
    assert (paper.end.told.torque_offs, paper.end.told.torque_problem) == (1, "")


def test_an_arming_that_fails_half_way_and_cannot_be_undone_owes_the_torque_off(paper: Paper) -> None:
    """It was told, and then nobody tried again: some servos pulled on."""

    def arm() -> None:
        raise TorqueStillOn("servo 5 did not take it; torque of right is not proven to be off: cut the servos' power")

    paper.bus.arm = arm
    paper.reads()
    paper.bus.torque_stays = True
    paper.hear(request="arm")
    assert "servo 5 did not take it" in str(paper.end.answers[0][1])
    paper.turn()
    paper.loop._publish(paper.now_s)
    assert "torque of right is not proven to be off" in paper.end.told.torque_problem
    paper.bus.torque_stays = False
    paper.turn()
    paper.loop._publish(paper.now_s)
    assert paper.bus.told[-1] == "torque off"
    assert (paper.end.told.torque_offs, paper.end.told.torque_problem) == (1, "")


def test_a_torque_off_that_was_asked_for_while_the_port_was_gone_is_owed(paper: Paper) -> None:
    paper.loop._lose_port()
    paper.bus.is_open = False
    paper.hear(request="torque off")
    _, error = paper.end.answers[0]
    assert isinstance(error, TorqueStillOn)
    paper.bus.is_open = True
    paper.turn()
    assert paper.bus.told == ["let go", "torque off"]


def test_a_port_that_is_lost_forgets_no_torque_off(paper: Paper) -> None:
    """Without the policy, too: somebody had asked for it."""
    _off_after(paper, 4)
    paper.hear(request="torque off")
    paper.loop._lose_port()
    paper.turn()
    assert paper.bus.told == ["torque off"]


def _six_of_seven(paper: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    """The port is back, and one servo's cable has come off: the bus cannot be opened."""
    monkeypatch.setattr(bus_process.os.path, "exists", lambda _: True)
    paper.bus.is_open = False
    paper.bus.missing = "servo up (id 3): no answer"


def test_six_servos_of_seven_let_go_when_the_port_comes_back_without_the_seventh(
    paper: Paper, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bus that cannot be opened never tried the torque-off that it owed, and the six went on pulling."""
    paper.loop._release.request()
    paper.loop._lose_port()
    _six_of_seven(paper, monkeypatch)
    paper.loop._reopen(paper.now_s)
    assert paper.bus.told == ["let go"]
    paper.loop._publish(paper.now_s)
    assert paper.end.told.torque_problem == "torque of up is not proven to be off: cut the servos' power"
    paper.bus.missing = ""
    paper.loop._reopen(paper.now_s)
    paper.turn()
    assert paper.bus.told == ["let go", "open", "torque off"]
    paper.loop._publish(paper.now_s)
    assert (paper.end.told.torque_offs, paper.end.told.torque_problem) == (1, "")


def test_they_let_go_when_the_process_ends_too(paper: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    paper.loop._release.request()
    paper.loop._lose_port()
    _six_of_seven(paper, monkeypatch)
    paper.loop.end()
    paper.loop.run()
    assert paper.bus.told == ["let go", "close"]
    assert "torque of up is not proven to be off" in paper.end.words[0]


def test_nobody_lets_go_of_wires_when_no_torque_off_is_owed(paper: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    paper.loop._lose_port()
    _six_of_seven(paper, monkeypatch)
    paper.loop._reopen(paper.now_s)
    assert paper.bus.told == []


def test_arming_says_why_the_port_that_came_back_is_not_open(paper: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    """The cable was in, and all that the operator was told was to plug it in."""
    paper.loop._lose_port()
    _six_of_seven(paper, monkeypatch)
    paper.loop._reopen(paper.now_s)
    paper.hear(request="arm")
    assert str(paper.end.answers[0][1]) == "not armed: servo up (id 3): no answer"


@pytest.mark.parametrize("how", ["signal", "alone"])
def test_a_torque_off_that_is_owed_is_paid_before_the_process_ends(paper: Paper, how: str) -> None:
    _off_after(paper, 6)
    paper.hear(request="torque off")
    if how == "signal":
        paper.loop.end()
    else:
        paper.end.is_alone = True
    paper.loop.run()
    assert paper.bus.told == ["torque off", "close"]
    assert paper.end.words == []


def test_a_process_that_cannot_prove_it_says_so_with_its_send_fatal(paper: Paper, caplog: pytest.LogCaptureFixture) -> None:
    _off_after(paper, 1000)
    paper.hear(request="torque off")
    paper.loop.end()
    paper.loop.run()
    assert paper.bus.told == ["close"]
    assert len(paper.end.words) == 1
    assert "torque of right is not proven to be off: cut the servos' power" in paper.end.words[0]
    assert "not proven" in caplog.text


def test_a_stop_that_nobody_has_heard_is_heard_before_the_process_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    paper = Paper(monkeypatch, torque_off_on_stop=True)
    paper.end.stop = True
    paper.loop.end()
    paper.loop.run()
    assert paper.bus.told == ["hold", "torque off", "close"]


def test_arming_looks_where_the_joints_are_now(paper: Paper) -> None:
    """A quiet bus was not read for long: meanwhile somebody has turned a joint by hand."""
    for before_mm, now_mm, told in ((0.0, 407.0, []), (407.0, 0.0, ["arm"])):
        paper.reads(before_mm)
        paper.loop._read_decide_write()
        paper.reads(now_mm)
        paper.hear(request="arm")
        assert paper.bus.told == told
    refused, armed = (error for _, error in paper.end.answers)
    assert "advance at 407.00 mm (-5 to 400 mm)" in str(refused)
    assert armed is None


@pytest.mark.parametrize("late", [1, 9])
def test_arming_looks_again_where_an_answer_is_late(paper: Paper, late: int) -> None:
    """The guard takes in whole sets only: else one late answer would let a joint outside its envelope be armed."""
    reads = 0

    def read() -> tuple[MissingServo | ServoState, ...]:
        nonlocal reads
        reads += 1
        states = [
            ServoState(joint.name, joint.id, paper.now_s, 0, 0, -7.0, 0.0, 0.0, 8.0, 12.0, 30.0, HardwareError(0), False, False)
            for joint in ServosConfig().joints
        ]
        silent = MissingServo(states[6].name, states[6].id, paper.now_s, 1, "no answer")
        return tuple(states[:6]) + ((silent,) if reads <= late else (states[6],))

    paper.end.heartbeat = lambda: None
    paper.bus.read = read
    paper.hear(request="arm")
    assert paper.bus.told == [], "where a joint is that does not answer, nobody knows"
    assert reads == min(late + 1, 3)


def test_a_robot_that_is_closed_while_it_connects_keeps_no_bus_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """F5 while "Servos on" starts a lost bus process again: that one would keep the port from the next rig."""
    opening, go_on = threading.Event(), threading.Event()
    alive: list[object] = []

    class PaperLink:
        failure = None

        def __init__(self, *_: object, **__: object) -> None:
            alive.append(self)

        def request(self, what: str, timeout_s: float) -> None:
            opening.set()
            assert go_on.wait(10.0)

        def close(self) -> None:
            alive.remove(self)

    monkeypatch.setattr(servo_robot, "BusClient", PaperLink)
    robot = ServoRobot(ServosConfig(port="/dev/none"), SafetyConfig())
    failed: list[NotReady] = []

    def connect() -> None:
        try:
            robot.connect()
        except NotReady as error:
            failed.append(error)

    thread = threading.Thread(target=connect)
    thread.start()
    assert opening.wait(10.0)
    robot.close()
    go_on.set()
    thread.join(10.0)
    assert alive == []
    assert "closed meanwhile" in str(failed[0])
    assert robot.bus_status() is None

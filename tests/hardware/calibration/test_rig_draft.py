"""A step of the wizard that is stopped half way leaves wires that nobody knows, and no zero is taken there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from core.calibration.camera import BoardError, BoardSpec
from core.calibration.servos import Assignment, HeadNotSeen, ServoFinding, SteeringNotSeen
from core.config.calibration import CalibrationConfig, DrumsConfig, ScaleConfig, SteeringConfig, TendonConfig, ZeroConfig
from core.config.models import Config
from core.config.safety import ServosConfig, wiring_of
from core.devices import DeviceError
from core.types import Frame, Image
from hardware.calibration import servo_identification
from hardware.calibration.rig_draft import RigDraft
from hardware.calibration.servo_identification import Zeros
from hardware.calibration.servo_probe import ProcedureStopped, StopSwitch, Strained
from hardware.rig import RigKind
from hardware.servos.discovery import FoundServo, FoundServos
from hardware.servos.dynamixel_port import NoAnswer
from tests.core.robots import TURNED

WHEN = datetime(2026, 1, 1, tzinfo=UTC)
TICKS = (2048, 2049, 2050, 2051, 0, 1, 2)


class Bench:
    """No camera and no servos: the wizard's steps are told what happens."""

    def __init__(self, kind: RigKind = RigKind.SIM) -> None:
        self.kind = kind
        self.stop = StopSwitch()
        self.pictures: Iterator[Image] = iter(())
        self.feed = SimpleNamespace(newest=None)

    def set_lens(self, _lens: object) -> None: ...

    def servos_config(self, servos: object) -> object:
        return servos

    def board_picture(self, _spec: BoardSpec) -> Image:
        return next(self.pictures)


@pytest.fixture
def draft(monkeypatch: pytest.MonkeyPatch) -> RigDraft:
    monkeypatch.setattr(servo_identification, "find_zeros", lambda *_: Zeros((0.1,) * 4))
    monkeypatch.setattr(servo_identification, "standing_ticks", lambda *_: TICKS)
    made = RigDraft(Bench(), Config())
    made.find_zeros()
    return made


def ends(monkeypatch: pytest.MonkeyPatch, step: str, error: BaseException) -> None:
    def broken(*_: object) -> None:
        raise error

    monkeypatch.setattr(servo_identification, step, broken)


@pytest.mark.parametrize("error", [ProcedureStopped("stopped"), KeyboardInterrupt()])
@pytest.mark.parametrize(("step", "run"), [("find_zeros", RigDraft.find_zeros), ("learn_steering", RigDraft.learn_steering)])
def test_stopped_half_way_there_are_no_zeros_until_they_are_found_anew(
    draft: RigDraft, monkeypatch: pytest.MonkeyPatch, step: str, run: Callable[[RigDraft], object], error: BaseException
) -> None:
    ends(monkeypatch, step, error)
    with pytest.raises(type(error)):
        run(draft)
    assert draft.zeros is None
    assert draft.zero is None
    assert not draft.are_zeros_known
    ends(monkeypatch, "learn_steering", AssertionError("zeroed where the wires happened to be"))
    with pytest.raises(DeviceError, match="find the zeros anew"):
        draft.learn_steering()
    monkeypatch.setattr(servo_identification, "find_zeros", lambda *_: Zeros((0.2,) * 4))
    draft.find_zeros()
    assert draft.are_zeros_known
    ends(monkeypatch, "learn_steering", HeadNotSeen("no head"))
    with pytest.raises(HeadNotSeen):
        draft.learn_steering()
    assert draft.are_zeros_known, "a look that fails lets the wires go back"


def test_a_tendon_that_could_not_be_told_is_known_once_it_was_put_there_by_hand(
    draft: RigDraft, monkeypatch: pytest.MonkeyPatch
) -> None:
    problems = ("up: the head does not follow", "down: the head does not follow")
    monkeypatch.setattr(servo_identification, "find_zeros", lambda *_: Zeros((0.0,) * 4, problems))
    monkeypatch.setattr(servo_identification, "nudge", lambda *_: None)
    draft.find_zeros()
    for name in ("right", "down"):
        draft.nudge(name, 0.2)
        assert not draft.are_zeros_known
    assert draft.zero is None
    draft.nudge("up", 0.2)
    assert draft.are_zeros_known
    draft.find_zeros()
    assert not draft.are_zeros_known
    assert draft.zero is None


def test_a_wire_that_strains_while_it_is_tightened_lets_all_go(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    ends(monkeypatch, "nudge", Strained("tendon up: 312 mA: let go"))
    with pytest.raises(Strained):
        draft.nudge("up", 0.1)
    assert not draft.are_zeros_known
    with pytest.raises(DeviceError, match="find the zeros anew"):
        draft.learn_steering()


def test_a_line_that_hiccups_afterwards_costs_no_zeros(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    ends(monkeypatch, "standing_ticks", NoAnswer("servo 3: no answer"))
    monkeypatch.setattr(servo_identification, "nudge", lambda *_: None)
    said: list[str] = []
    draft.say = said.append
    for step in (draft.find_zeros, lambda: draft.nudge("up", 0.1)):
        step()
        assert draft.are_zeros_known
        assert draft.zero is None
        assert "learn the steering, which keeps it, too" in said[-1]
    ends(monkeypatch, "learn_steering", HeadNotSeen("no head"))
    with pytest.raises(HeadNotSeen):
        draft.learn_steering()


def test_a_head_without_room_costs_no_zero(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    ends(monkeypatch, "learn_steering", SteeringNotSeen("feed the robot to a place where it has room"))
    for _ in range(2):
        with pytest.raises(SteeringNotSeen):
            draft.learn_steering()
    assert draft.zero is not None
    assert draft.are_zeros_known


def test_zeros_are_kept_without_the_steering(draft: RigDraft) -> None:
    draft.set_pretension(0.4)
    zero = draft.calibration().zero
    assert zero.found_utc is not None
    assert zero == ZeroConfig(ticks=TICKS, slack_mm=(0.1,) * 4, pretension_mm=0.4, found_utc=zero.found_utc)


@pytest.mark.parametrize("offered", [None, TICKS])
def test_without_a_search_the_steering_is_learnt_from_a_kept_zero_or_not_at_all(
    draft: RigDraft, monkeypatch: pytest.MonkeyPatch, offered: tuple[int, ...] | None
) -> None:
    """What the tendons stand at is checked when the servos are open."""
    kept: list[object] = []
    monkeypatch.setattr(servo_identification, "learn_steering", lambda *args: kept.append(args[3]) or ends_here())

    def ends_here() -> None:
        raise SteeringNotSeen("no room")

    zero = None if offered is None else ZeroConfig(ticks=offered, slack_mm=(0.0,) * 4, pretension_mm=0.3)
    known = CalibrationConfig(made_utc=WHEN, zero=zero)
    fresh = RigDraft(Bench(), Config(), known)
    error, said = (DeviceError, "find the zeros first") if zero is None else (SteeringNotSeen, "no room")
    with pytest.raises(error, match=said):
        fresh.learn_steering()
    assert kept == ([] if zero is None else [zero])
    with pytest.raises(SteeringNotSeen):
        draft.learn_steering()
    assert kept[-1] is None, "a search has just left them there"


def test_a_picture_of_the_bench_is_kept_with_its_scale(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    feed = cast("Bench", draft.bench).feed
    assert draft.calibration().view is None
    rng = np.random.default_rng(0)
    feed.newest = Frame(0, 0.0, rng.integers(0, 255, (480, 640, 3), np.uint8))
    first = draft.calibration().view
    assert first is not None
    feed.newest = Frame(1, 1.0, rng.integers(0, 255, (480, 640, 3), np.uint8))
    again = RigDraft(draft.bench, draft.config, draft.calibration())
    assert again.calibration().view == first, "what the scale was measured with"
    again.scale = ScaleConfig(mm_per_px=0.3, size_px=(640, 480), method="board", uncertainty_share=0.01)
    assert again.calibration().view not in {None, first}
    monkeypatch.setattr("hardware.calibration.rig_draft.find_board", lambda *_: None)
    again.scale = again.scale.model_copy(update={"mm_per_px": 0.4})
    assert again.calibration().view is None, "the board will not stay there"


def test_the_wiring_that_was_found_is_kept(draft: RigDraft) -> None:
    assert draft.calibration().wiring is None
    found = [Assignment(joint.name, joint.id, joint.sign, "seen") for joint in draft.servos.joints]
    found[0], found[1] = Assignment("right", 2, -1, "seen"), Assignment("left", 1, 1, "seen")
    draft.set_assignments(found)
    known = draft.calibration()
    assert known.wiring == ((2, -1), (1, 1), (3, 1), (4, 1), (5, 1), (6, 1), (7, 1)) == wiring_of(draft.config.servos)
    again = RigDraft(Bench(), draft.config, known)
    assert again.calibration().wiring == known.wiring


@pytest.mark.parametrize(("assumed", "sign", "learnt"), [(True, -1, 2), (False, 1, 1)])
def test_a_head_that_bends_to_the_other_side_turns_an_assumed_rotation_round(
    monkeypatch: pytest.MonkeyPatch, assumed: bool, sign: int, learnt: int
) -> None:
    """One camera shows no direction of a rotation before its shaft is turned and bent."""
    draft = RigDraft(Bench(), Config(servos=TURNED))
    draft.set_assignments([Assignment(one.name, one.id, 1, "seen", assumed and one.name == "rotation") for one in TURNED.joints])
    draft.zeros = Zeros((0.1, 0.2))
    asked: list[int] = []

    def learn(_bench: object, servos: ServosConfig, *_: object) -> servo_identification.LearnedSteering:
        asked.append(servos.joints[-1].sign)
        tendons = tuple(TendonConfig(name=one.name, moved_px=9.0, px_per_mm=6.0) for one in TURNED.tendons)
        roll_deg = 180.0 if len(asked) == 1 else 0.0
        steering = SteeringConfig(heading_deg=0.0, roll_deg=roll_deg, disagreement_deg=1.0, tendons=tendons)
        return servo_identification.LearnedSteering(steering, (1.0, 2.0), (1, 2, 3, 4))

    monkeypatch.setattr(servo_identification, "learn_steering", learn)
    steering = draft.learn_steering()
    assert (len(asked), draft.config.servos.joints[-1].sign) == (learnt, sign)
    assert (steering.roll_deg == 0.0) is assumed
    assert draft.are_zeros_known and draft.zero is not None
    assert draft.calibration().misfit(draft.config.servos) == ""


@pytest.mark.parametrize(
    ("elsewhere", "problem"),
    [
        (((57_600, (6, 7)),), r"^servos at several speeds: 1, 2, 3, 4, 5 at 1000000 baud; 6, 7 at 57600 baud; set all"),
        ((), r"^5 servos answer, 7 are needed: .*check cables"),
    ],
)
def test_what_keeps_servos_from_being_seven_is_told(
    draft: RigDraft, monkeypatch: pytest.MonkeyPatch, elsewhere: tuple[tuple[int, tuple[int, ...]], ...], problem: str
) -> None:
    draft.config = draft.config.model_copy(update={"servos": draft.config.servos.model_copy(update={"port": "/dev/ttyUSB0"})})
    found = FoundServos("/dev/ttyUSB0", 1_000_000, tuple(FoundServo(k, 1020) for k in range(1, 6)), elsewhere)
    monkeypatch.setattr("hardware.calibration.rig_draft.find_servos", lambda *_: found)
    with pytest.raises(DeviceError, match=problem):
        draft.search_servos()


def test_what_was_seen_of_a_servo_that_is_gone_is_forgotten(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    draft.config = draft.config.model_copy(update={"servos": draft.config.servos.model_copy(update={"port": "/dev/ttyUSB0"})})
    draft.set_assignments([Assignment(joint.name, joint.id, joint.sign, "seen") for joint in draft.servos.joints])
    draft.findings = dict.fromkeys(range(1, 8), ServoFinding("advance", 1, "seen"))
    found = FoundServos("/dev/ttyUSB0", 1_000_000, tuple(FoundServo(k, 1020) for k in (1, 2, 3, 4, 5, 6, 9)))
    monkeypatch.setattr("hardware.calibration.rig_draft.find_servos", lambda *_: found)
    draft.search_servos()
    assert sorted(draft.findings) == [1, 2, 3, 4, 5, 6]
    assert draft.assignments == ()


DRUMS = DrumsConfig(tendons_mm=12.0, advance_mm=20.0, delivery_mm=15.0)


@pytest.mark.parametrize(
    "step",
    [RigDraft.find_zeros, lambda draft: draft.wiggle(3), lambda draft: draft.identify_one(3),
     lambda draft: draft.nudge("up", 0.1)],
    ids=["zeros", "wiggle", "identify", "nudge"],
)  # fmt: skip
def test_nothing_moves_on_a_live_rig_before_its_drums_are_known(
    monkeypatch: pytest.MonkeyPatch, step: Callable[[RigDraft], object]
) -> None:
    for name in ("find_zeros", "learn_steering", "wiggle", "identify_servo", "nudge"):
        ends(monkeypatch, name, AssertionError("it moved"))
    draft = RigDraft(Bench(RigKind.LIVE), Config())
    draft.found = FoundServos("/dev/ttyUSB0", 1_000_000, tuple(FoundServo(k, 1020) for k in range(1, 8)))
    with pytest.raises(DeviceError, match=r"^say the diameters of the drums before anything moves"):
        step(draft)
    draft.set_drums(DRUMS)
    with pytest.raises(AssertionError, match="it moved"):
        step(draft)


def test_drums_become_ways_per_turn_and_what_was_found_with_others_is_forgotten(draft: RigDraft) -> None:
    assert draft.zero is not None
    draft.set_drums(DRUMS)
    assert [joint.mm_per_turn for joint in draft.config.servos.joints] == pytest.approx(
        [37.6991] * 4 + [62.8319] + [47.1239] * 2, abs=1e-4
    )
    assert (draft.zero, draft.zeros, draft.steering) == (None, None, None)
    known = draft.calibration()
    assert known.drums == DRUMS
    assert DRUMS.fit(draft.config.servos)
    assert not DRUMS.fit(ServosConfig())
    draft.find_zeros()
    draft.set_drums(DRUMS)
    assert draft.zero is not None, "the same drums again forget nothing"
    assert RigDraft(Bench(), draft.config, known).drums == DRUMS


def _search(draft: RigDraft, monkeypatch: pytest.MonkeyPatch, **models: int) -> None:
    """Search servos 1 to 7 of XM430-W350, those named (s1 to s7) of another model."""
    draft.config = draft.config.model_copy(update={"servos": draft.config.servos.model_copy(update={"port": "/dev/ttyUSB0"})})
    found = FoundServos("/dev/ttyUSB0", 1_000_000, tuple(FoundServo(k, models.get(f"s{k}", 1020)) for k in range(1, 8)))
    monkeypatch.setattr("hardware.calibration.rig_draft.find_servos", lambda *_: found)
    draft.search_servos()


def test_small_servos_for_the_wires_beside_strong_ones(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    _search(draft, monkeypatch, s1=1200, s2=1200, s3=1200, s4=1200)
    servos = draft.config.servos
    assert [servos.model_of(joint).number for joint in servos.joints] == [1200] * 4 + [1020] * 3
    assert [servos.lowest_v(joint) for joint in servos.joints] == [4.4] * 4 + [10.5] * 3
    # the servos are found to sit elsewhere: their models move with them
    order = (5, 6, 7, 1, 2, 3, 4)
    names = ("right", "left", "up", "down", "advance", "delivery_1", "delivery_2")
    draft.set_assignments([Assignment(name, one, 1, "seen") for name, one in zip(names, order, strict=True)])
    servos = draft.config.servos
    assert [servos.model_of(joint).number for joint in servos.joints] == [1020] * 3 + [1200] * 4


def test_a_limit_of_the_supply_belongs_to_the_servos_that_were_there(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    servos = draft.config.servos.model_copy(update={"min_voltage_v": 10.5})
    draft.config = draft.config.model_copy(update={"servos": servos})
    _search(draft, monkeypatch)
    assert draft.config.servos.min_voltage_v == 10.5
    _search(draft, monkeypatch, **{f"s{k}": 1240 for k in range(1, 8)})
    assert draft.config.servos.min_voltage_v is None


def test_a_servo_of_another_series_is_named(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DeviceError, match=r"^id 3: servo XL-320 \(350\) is not supported"):
        _search(draft, monkeypatch, s3=350)


def test_the_servos_wait_until_the_board_is_away(draft: RigDraft, monkeypatch: pytest.MonkeyPatch) -> None:
    board, empty, said = np.ones((2, 2), np.uint8), np.zeros((2, 2), np.uint8), []

    def find_board(image: Image, _spec: BoardSpec) -> None:
        if not image.any():
            raise BoardError("no board is seen")

    monkeypatch.setattr("hardware.calibration.rig_draft.find_board", find_board)
    draft.say = said.append
    bench = cast("Bench", draft.bench)
    monkeypatch.setattr("hardware.calibration.rig_draft._BOARD_LOOK_S", 0.0)
    bench.pictures = iter([board, board, *[empty] * 5, board, *[empty] * 6])
    draft.wait_for_no_board()
    assert said == ["take the board away: the servos move when it is out of sight"]
    assert next(bench.pictures, None) is None, "a hand over it is not enough"
    bench.pictures = iter([board] * 9)
    with pytest.raises(BoardError, match="still in the picture: take it away"):
        draft.wait_for_no_board(0.0)

"""Calibration of the servos from drawn paths with known motion, and the kept zero (a turn has 4096 ticks and is 40 mm of way)."""

import math

import numpy as np
import pytest

from core.calibration.servos import (
    Function,
    HeadMove,
    HeadNotSeen,
    Look,
    NeverTaut,
    NotIdentified,
    Pull,
    ServoFinding,
    SteeringNotSeen,
    TautReading,
    Wiggle,
    angle_deg,
    assign,
    classify,
    feed_disagreement,
    head_move,
    is_begun,
    is_enough,
    learn,
    sheath_growth,
    taut_at_mm,
    turn_deg,
)
from core.config.calibration import ScaleConfig
from core.config.safety import JOINT_NAMES, ServosConfig
from core.types import Image, Points
from tests.core.robots import ADVANCE, ROTATION, robot, tendons

BLANK: Image = np.full((480, 640, 3), 120, np.uint8)
ROBOT_PX = 300.0
TIP_PX = 46.0


def path(bend_deg: float = 0.0, *, length_px: float = ROBOT_PX, end_px: float = 0.0, shorter: float = 1.0) -> Points:
    """A robot from the left border along y = 240; the last 46 px bend to the right (down). ``end_px`` is seen beyond its end."""
    straight = length_px - TIP_PX
    along = np.arange(0.0, TIP_PX * shorter + end_px + 0.5)
    angle = math.radians(bend_deg) / (TIP_PX * shorter)
    x = along if abs(angle) < 1e-9 else np.sin(angle * along) / angle
    y = 0.0 * along if abs(angle) < 1e-9 else (1 - np.cos(angle * along)) / angle
    body = np.column_stack([np.arange(0.0, straight), np.full(len(np.arange(0.0, straight)), 240.0)])
    return np.vstack([body, np.column_stack([straight + x, 240.0 + y])])


def look(points: Points, image: Image = BLANK) -> Look:
    return Look((points,) * 3, image)


def _move(lateral_px: float = 0.0, longer_px: float = 0.0, along_px: float = 0.0) -> HeadMove:
    return HeadMove(np.array([along_px, lateral_px]), lateral_px, longer_px)


# ---- looks


def test_a_robot_that_is_hardly_seen_is_no_look() -> None:
    with pytest.raises(HeadNotSeen, match="head is not seen"):
        Look((path(), path()), BLANK)
    with pytest.raises(HeadNotSeen, match="too little of the robot"):
        Look((path()[:30],) * 3, BLANK)


def test_a_bent_head_moves_sideways() -> None:
    move = head_move(look(path()), look(path(20.0)))
    # an arc of 46 px through 20 degrees: 46 (1 - cos 20) / 0.349 = 7.9 px to the right
    assert move.lateral_px == pytest.approx(7.9, abs=0.3)
    assert move.longer_px == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize("end_px", [-3.0, 0.0, 3.0])
def test_where_the_mask_ends_does_not_turn_the_way(end_px: float) -> None:
    move = head_move(look(path()), look(path(20.0, end_px=end_px)))
    true = head_move(look(path()), look(path(20.0)))
    assert abs(turn_deg(angle_deg(true.vector), angle_deg(move.vector))) < 2.0


def test_a_robot_that_is_fed_is_longer_and_does_not_move_sideways() -> None:
    move = head_move(look(path()), look(path(length_px=305.0)))
    assert move.longer_px == pytest.approx(5.0, abs=0.6)
    assert move.lateral_px == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("first", "second", "turn"), [(0.0, 90.0, 90.0), (170.0, -170.0, 20.0), (-170.0, 170.0, -20.0)])
def test_turns_go_the_short_way(first: float, second: float, turn: float) -> None:
    assert turn_deg(first, second) == pytest.approx(turn)


def test_a_finer_camera_sees_the_same_motion() -> None:
    """Thresholds stand for the network's noise, which is one of working pixels."""
    coarse = head_move(look(path()), look(path(20.0)))
    fine = head_move(*(Look((3.0 * points,) * 3, BLANK, 1 / 3) for points in (path(), path(20.0))))
    assert fine.lateral_px == pytest.approx(coarse.lateral_px, abs=0.1)
    assert fine.longer_px == pytest.approx(coarse.longer_px, abs=0.1)
    twitch = [Look((3.0 * points,) * 3, BLANK, 1 / 3) for points in (path(), path(5.0), path())]
    assert classify(Wiggle(0.75, *twitch)) is None, "two working pixels, whatever the camera makes of them"


# ---- who is who


@pytest.mark.parametrize(
    ("plus", "minus", "function", "sign"),
    [
        (path(20.0), path(0.0), Function.RIGHT, 1),
        (path(0.0), path(20.0), Function.RIGHT, -1),
        (path(-20.0), path(-1.0), Function.LEFT, 1),
        (path(2.0), path(-20.0), Function.LEFT, -1),
        (path(length_px=303.0), path(length_px=297.0), Function.ADVANCE, 1),
        (path(length_px=297.0), path(length_px=303.0), Function.ADVANCE, -1),
        (path(length_px=297.0), path(), Function.PITCH, 1),
        (path(), path(length_px=297.0), Function.PITCH, -1),
    ],
)
def test_a_wire_acts_one_way_and_a_drum_both_ways(plus: Points, minus: Points, function: Function, sign: int) -> None:
    found = classify(Wiggle(0.75, look(path()), look(plus), look(minus)))
    assert (found.function, found.sign) == (function, sign)


def test_what_acts_both_ways_sideways_is_not_named() -> None:
    assert classify(Wiggle(0.75, look(path()), look(path(15.0)), look(path(-15.0)))) is None


def _sheathed(length_px: int) -> Image:
    image = BLANK.copy()
    image[236:245, :290] = 30
    image[232:249, :length_px] = 200
    return image


def test_a_sheath_grows_where_the_picture_changed() -> None:
    assert sheath_growth(path(), _sheathed(60), _sheathed(72)) == pytest.approx(12.0, abs=3.0)
    assert sheath_growth(path(), _sheathed(72), _sheathed(60)) == pytest.approx(-12.0, abs=3.0)
    assert sheath_growth(path(), _sheathed(60), _sheathed(60)) == 0.0
    assert sheath_growth(path(), _sheathed(0), _sheathed(12)) == pytest.approx(12.0, abs=3.0)


def test_the_catheter_is_told_by_its_sheath_once_the_servo_has_gone_far() -> None:
    for amplitude_mm, sign in ((1.5, -1), (0.75, None)):
        found = classify(Wiggle(amplitude_mm, look(path()), look(path(), _sheathed(60)), look(path(), _sheathed(72))))
        assert (found.sign if found is not None else None) == sign


TENDONS = ServosConfig().tendons
ALL = {
    4: Function.RIGHT,
    9: Function.LEFT,
    2: Function.PITCH,
    5: Function.PITCH,
    1: Function.ADVANCE,
    7: Function.DELIVERY,
    3: Function.DELIVERY,
}


def test_names_follow_from_functions_and_the_order_of_ids() -> None:
    named = assign({servo_id: ServoFinding(function, -1, "") for servo_id, function in ALL.items()}, ServosConfig())
    assert tuple(one.name for one in named) == JOINT_NAMES
    assert [one.id for one in named] == [4, 9, 2, 5, 1, 3, 7]
    assert [one.name for one in named if one.assumed] == ["up", "down"]
    assert {one.sign for one in named} == {-1}


def test_a_missing_and_a_double_function_are_named() -> None:
    found = {servo_id: ServoFinding(function, 1, "") for servo_id, function in ALL.items() if servo_id != 4}
    with pytest.raises(NotIdentified, match=r"1 that pulls the head to the right \(found: none\)"):
        assign(found, ServosConfig())
    found |= {4: ServoFinding(Function.LEFT, 1, "")}
    with pytest.raises(NotIdentified, match=r"to the left \(found: 4, 9\)"):
        assign(found, ServosConfig())


@pytest.mark.parametrize(
    ("servos", "seen", "assumed"),
    [
        (robot(*tendons(90.0, 210.0, 330.0), ADVANCE), "PLR", set()),
        (robot(*tendons(0.0, 120.0, 240.0), ADVANCE), "RLL", {"tendon_2", "tendon_3"}),
        (robot(*tendons(90.0, 270.0), ADVANCE, ROTATION), "PP", {"tendon_1", "tendon_2", "rotation"}),
        (robot(*tendons(0.0, 180.0), ADVANCE, ROTATION), "RL", {"rotation"}),
        (robot(*tendons(180.0, 0.0), ADVANCE), "LR", set()),
    ],
)
def test_robots_of_other_shapes_are_told_apart_by_the_directions_of_their_tendons(
    servos: ServosConfig, seen: str, assumed: set[str]
) -> None:
    """Of a rotation nothing is seen: it is the servo that is left."""
    functions = [{"R": Function.RIGHT, "L": Function.LEFT, "P": Function.PITCH}[one] for one in seen] + [Function.ADVANCE]
    found = {20 + place: ServoFinding(function, -1, "") for place, function in enumerate(functions)}
    line = [*found, 7] if "rotation" in servos.names else list(found)
    named = assign(found, servos, line)
    assert tuple(one.name for one in named) == servos.names
    assert [one.id for one in named] == line
    assert {one.name for one in named if one.assumed} == assumed
    if "rotation" in servos.names:
        with pytest.raises(NotIdentified, match=r"1 of which nothing is seen, the rotation \(found: 7, 8\)"):
            assign(found, servos, [*line, 8])


# ---- steering


def test_the_directions_of_three_tendons_follow_from_the_bends() -> None:
    found = learn(_pulls(), np.array([1.0, 0.0]), robot(*tendons(90.0, 210.0, 330.0), ADVANCE).tendons)
    assert [one.name for one in found.tendons] == ["tendon_1", "tendon_2", "tendon_3"]
    assert [one.direction_deg for one in found.tendons] == [None, pytest.approx(-90.0), pytest.approx(90.0)]
    assert found.tendons[2].px_per_mm == pytest.approx(math.hypot(8.0, 1.0) / 0.4 * math.cos(math.radians(30.0)))
    rolled = learn(_pulls(60.0, way_px=20.0), np.array([1.0, 0.0]), robot(*tendons(90.0, 210.0, 330.0), ADVANCE).tendons)
    assert rolled.roll_deg == pytest.approx(60.0)
    assert [one.direction_deg for one in rolled.tendons] == [pytest.approx(90.0), pytest.approx(-90.0), None]


def _pulls(roll_deg: float = 0.0, way_px: float = 8.0, retreat_px: float = 1.0) -> dict[str, Pull]:
    """A robot that points to the right: its right is down in the picture. Every bend also draws the head back a little."""
    cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    ways = {"right": cos, "left": -cos, "up": sin, "down": -sin}
    return {name: Pull(0.4, _move(way_px * share, along_px=-retreat_px)) for name, share in ways.items()}


def test_tendons_that_act_in_the_picture() -> None:
    found = learn(_pulls(), np.array([1.0, 0.0]), TENDONS)
    directions = {tendon.name: tendon.direction_deg for tendon in found.tendons}
    assert directions["right"] == pytest.approx(90.0)
    assert directions["left"] == pytest.approx(-90.0)
    assert directions["up"] is None
    assert directions["down"] is None
    assert found.roll_deg == pytest.approx(0.0)
    assert found.tendons[0].px_per_mm == pytest.approx(math.hypot(8.0, 1.0) / 0.4)


def test_the_tips_turn_is_positive_to_the_right() -> None:
    assert head_move(look(path()), look(path(20.0))).turned_deg == pytest.approx(16.5, abs=1.0)  # its last 16 of 46 px
    assert head_move(look(path(10.0)), look(path(-10.0))).turned_deg == pytest.approx(-16.5, abs=1.0)


def test_the_turn_per_millimetre_is_that_of_the_freer_side() -> None:
    pulls = _pulls()
    assert learn(pulls, np.array([1.0, 0.0]), TENDONS).turn_deg_per_mm is None, "the head did not turn"
    for name, sign, turned_deg in (("right", 1.0, 12.0), ("left", -1.0, 18.0)):
        move = pulls[name].move
        pulls[name] = Pull(0.4, HeadMove(move.vector, move.lateral_px, move.longer_px, sign * turned_deg))
    assert learn(pulls, np.array([1.0, 0.0]), TENDONS).turn_deg_per_mm == pytest.approx(45.0)
    swapped = pulls | {"right": pulls["left"], "left": pulls["right"]}
    found = learn(swapped, np.array([1.0, 0.0]), TENDONS)
    assert (found.turn_deg_per_mm, abs(found.roll_deg)) == (pytest.approx(45.0), pytest.approx(180.0))
    assert learn(_pulls(90.0, way_px=20.0), np.array([1.0, 0.0]), TENDONS).turn_deg_per_mm is None, "it acts out of the picture"


@pytest.mark.parametrize("roll_deg", [-60.0, 30.0, 90.0, 180.0])
def test_a_robot_that_is_rolled(roll_deg: float) -> None:
    found = learn(_pulls(roll_deg, way_px=20.0), np.array([1.0, 0.0]), TENDONS)
    assert abs(turn_deg(found.roll_deg, roll_deg)) < 1.0


def test_way_and_heading_bear_witness_together() -> None:
    pulls = _pulls()
    turned = {
        name: Pull(pull.pull_mm, HeadMove(_turned(pull.move.vector, 6.0), pull.move.lateral_px, 0.0))
        for name, pull in pulls.items()
    }
    found = learn(turned, np.array([1.0, 0.0]), TENDONS)
    assert found.disagreement_deg == pytest.approx(6.0, abs=0.1)
    assert found.tendons[0].direction_deg == pytest.approx(93.0, abs=0.2)


def _turned(vector: Points, angle_deg_: float) -> Points:
    cos, sin = math.cos(math.radians(angle_deg_)), math.sin(math.radians(angle_deg_))
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])


def test_where_one_side_is_a_wall_the_heading_decides() -> None:
    pulls = _pulls()
    pulls["right"] = Pull(0.4, _move(0.5))
    pulls["left"] = Pull(0.4, _move(-9.0, along_px=-2.0))
    assert learn(pulls, np.array([1.0, 0.0]), TENDONS).tendons[1].direction_deg == pytest.approx(-90.0)


def test_a_head_against_the_wall_teaches_nothing() -> None:
    with pytest.raises(SteeringNotSeen, match="against a wall"):
        learn(_pulls(way_px=2.0), np.array([1.0, 0.0]), TENDONS)


# ---- taut


def test_the_line_is_followed_back_to_where_it_starts() -> None:
    # taut at 0.5 mm, 20 px per mm
    steps = [TautReading(at, _move(-20.0 * max(0.0, at - 0.5))) for at in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)]
    assert taut_at_mm(steps) == pytest.approx(0.5, abs=0.001)
    assert [is_begun(step) for step in steps] == [False, False, False, True, True, True]
    assert is_enough(steps[-1])
    assert not is_enough(steps[-2])


def test_out_of_the_picture_the_root_of_the_shortening_is_the_line() -> None:
    steps = [TautReading(at, _move(longer_px=-5.0 * max(0.0, at - 0.2) ** 2)) for at in (0.0, 0.2, 0.4, 0.5, 0.6, 0.75)]
    assert taut_at_mm(steps) == pytest.approx(0.2, abs=0.01)


def test_a_wire_that_was_never_slack_is_told() -> None:
    steps = [
        TautReading(at, _move(-20.0 * (at - 0.2))) for at in (0.3, 0.36, 0.42, 0.48)
    ]  # taut at 0.2 mm, before the first of them
    with pytest.raises(NeverTaut, match="taut before it was pulled: loosen it"):
        taut_at_mm(steps)


def test_a_wire_that_is_hung_out_is_told() -> None:
    with pytest.raises(NeverTaut):
        taut_at_mm([TautReading(at, _move(0.2)) for at in (0.0, 0.5, 1.0)])
    with pytest.raises(NeverTaut):
        taut_at_mm([TautReading(0.0, _move()), TautReading(0.5, _move(8.0))])


# ---- how far the feed goes


@pytest.mark.parametrize(("mm_per_px", "told"), [(0.25, ""), (0.22, ""), (0.36, "about 58 mm"), (0.15, "about 24 mm")])
def test_a_feed_that_goes_another_way_than_it_was_sent_is_told(mm_per_px: float, told: str) -> None:
    """3 mm both ways are 12 px at 0.25 mm/px; the scale is one of pictures half as large."""
    fed = classify(Wiggle(3.0, look(path()), look(path(length_px=312.0)), look(path(length_px=288.0))))
    findings = {servo_id: ServoFinding(function, 1, "") for servo_id, function in ALL.items()} | {1: fed}
    scale = ScaleConfig(mm_per_px=2.0 * mm_per_px, size_px=(320, 240), method="board", uncertainty_share=0.01)
    servos = ServosConfig()
    assert {joint.mm_per_turn for joint in servos.joints} == {40.0}
    line = feed_disagreement(findings, assign(findings, servos), servos, scale, (640, 480))
    assert bool(line) is bool(told)
    assert told in line

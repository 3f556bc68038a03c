"""Handed over on a rig that is wired wrong, in lock-step: how far twin, perception, pilot and gate go the wrong way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from core.config.safety import JOINT_NAMES, TENDONS, JointName
from core.control.faults import Cause
from core.control.gate import Source
from core.control.modes import Act, Mode
from core.control.pilot import PERIOD_S
from core.types import Point
from hardware.twin.actuation import JointsToTwin
from tools.fault_campaign.bench import TARGET, FaultBench, open_bench
from tools.fault_campaign.registry import Kit
from tools.lockstep import LockStepServos

MOST_DEG, MOST_S = 10.0, 1.0
"""What a robot may turn, or go, the wrong way."""

Wiring = Callable[[Sequence[float]], Sequence[float]]
"""Where the joints of the robot really are, from where those of the servos are."""


@dataclass
class Course:
    """What happened after the hand-over: the largest turn of the tip against the bend as it is meant, the way back, and the end of
    autonomy."""

    wrong_deg: float
    wrong_mm: float
    cause: Cause | None
    after_s: float
    modes: list[Mode]


def _heading_deg(bench: FaultBench) -> float:
    points = bench.world.physics.robot_points_mm()
    return float(np.degrees(np.arctan2(*(points[-1] - points[-4])[::-1])))


def _handed_over(
    bench: FaultBench, wiring: Wiring, seconds: float, target: Point = TARGET, *, roll_deg: float = 0.0, side: int = 1
) -> Course:
    robot = bench.robot
    joints = JointsToTwin(bench.config.servos, wiring(robot.positions_mm()), roll_deg)
    bench.world.drive = lambda duration_s: joints.command(wiring(robot.positions_mm()), duration_s)
    bench.engine.set_target(target)
    bench.arm()
    bench.held = True
    assert bench.until(lambda view: not view.against_hand_over and view.deadman is True, 3.0), bench.view.against_hand_over
    bench.pilot.ask(Act.HAND_OVER)
    start_deg, start_mm, start_bend = _heading_deg(bench), bench.world.physics.status().insertion_mm, _bend(robot, bench)
    wrong_deg, wrong_mm, modes = 0.0, 0.0, [bench.mode]
    for turn in range(round(seconds / PERIOD_S)):
        view = bench.turn()
        modes += [view.mode] if view.mode is not modes[-1] else []
        commanded = side * (_bend(robot, bench) - start_bend)
        turned_deg = (_heading_deg(bench) - start_deg + 180.0) % 360.0 - 180.0
        wrong_deg = max(wrong_deg, -math.copysign(1.0, commanded) * turned_deg if abs(commanded) > 0.01 else 0.0)
        wrong_mm = max(wrong_mm, start_mm - bench.world.physics.status().insertion_mm)
        if view.latched is not None:
            return Course(wrong_deg, wrong_mm, view.latched.cause, turn * PERIOD_S, modes)
    return Course(wrong_deg, wrong_mm, None, seconds, modes)


def _bend(robot: LockStepServos, bench: FaultBench) -> float:
    right, left, *_ = robot.positions_mm()
    return (right - left) / (2.0 * bench.config.servos.max_pull_mm)


@contextmanager
def _bench(folder: Path, seen: Callable[[NDArray[Any]], NDArray[Any]] = lambda picture: picture) -> Iterator[FaultBench]:
    """`seen`: how the camera shows the masks of what is there."""
    with open_bench(Kit(folder, live=False)) as bench:
        bench.hooks.masks = lambda vessel, robot: (np.ascontiguousarray(seen(vessel)), np.ascontiguousarray(seen(robot)))
        bench.run(1.0)
        yield bench


def _swapped(one: JointName, other: JointName) -> Wiring:
    a, b = JOINT_NAMES.index(one), JOINT_NAMES.index(other)
    order = list(range(len(JOINT_NAMES)))
    order[a], order[b] = b, a
    return lambda joints: [joints[place] for place in order]


def _reversed(name: JointName) -> Wiring:
    place = JOINT_NAMES.index(name)
    return lambda joints: [-at if k == place else at for k, at in enumerate(joints)]


def test_wired_right_it_drives_on(tmp_path: Path) -> None:
    with _bench(tmp_path) as bench:
        found = _handed_over(bench, list, 4.0)
    assert (found.cause, found.modes[-1]) == (None, Mode.AUTONOMOUS)
    assert found.wrong_deg <= MOST_DEG


def test_right_and_left_swapped_ends_it_within_ten_degrees(tmp_path: Path) -> None:
    with _bench(tmp_path) as bench:
        found = _handed_over(bench, _swapped("right", "left"), 8.0)
        assert "against a bend of" in str(bench.view.latched)
        assert bench.view.permitted is Source.OPERATOR, "by hand it goes on"
    assert (found.cause, found.modes[-1]) == (Cause.WRONG_TURN, Mode.ADVISORY)
    assert found.wrong_deg <= MOST_DEG


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other"), [pair for pair in itertools.combinations(TENDONS, 2) if pair != ("right", "left")])
def test_no_two_swapped_tendons_turn_it_the_wrong_way(tmp_path: Path, one: JointName, other: JointName) -> None:
    """A tendon that acts out of the picture in the place of one that acts in it turns the head by less, or not at all."""
    with _bench(tmp_path) as bench:
        found = _handed_over(bench, _swapped(one, other), 6.0)
    assert found.wrong_deg <= MOST_DEG, found


def test_a_feed_that_goes_backwards_ends_it_within_a_second(tmp_path: Path) -> None:
    """Though it is fed by 1 mm/s alone, as the head turns first."""
    with _bench(tmp_path) as bench:
        found = _handed_over(bench, _reversed("advance"), 8.0)
    assert (found.cause, found.modes[-1]) == (Cause.WRONG_FEED, Mode.ADVISORY)
    assert found.after_s <= MOST_S
    assert found.wrong_mm <= 1.5


def test_a_robot_that_is_turned_over_in_its_holder_ends_it_within_ten_degrees(tmp_path: Path) -> None:
    with _bench(tmp_path) as bench:
        found = _handed_over(bench, list, 8.0, roll_deg=180.0)
    assert found.cause is Cause.WRONG_TURN
    assert found.wrong_deg <= MOST_DEG


def test_a_camera_that_sees_the_bench_from_below_ends_it_within_ten_degrees(tmp_path: Path) -> None:
    with _bench(tmp_path, lambda picture: picture[:, ::-1]) as bench:
        found = _handed_over(bench, list, 8.0, (639.0 - TARGET[0], TARGET[1]), side=-1)
    assert found.cause is Cause.WRONG_TURN
    assert found.wrong_deg <= MOST_DEG


def test_a_camera_that_is_turned_by_half_a_turn_sees_right_as_right(tmp_path: Path) -> None:
    with _bench(tmp_path, lambda picture: picture[::-1, ::-1]) as bench:
        found = _handed_over(bench, list, 4.0, (639.0 - TARGET[0], 479.0 - TARGET[1]))
    assert (found.cause, found.modes[-1]) == (None, Mode.AUTONOMOUS)
    assert found.wrong_deg <= MOST_DEG

"""Robots of other shapes in the twin: wires to bend, joints to physics, and the head that follows commands on the screen."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from core.config.models import RESOURCES, TwinConfig
from core.config.rig_file import read_rig
from core.config.safety import ServosConfig
from core.control.joints import bend_of, direction
from core.types import Command
from hardware.servos.dynamixel_bus import ServoBus
from hardware.twin.actuation import JointsToTwin, wires_bend_mm
from hardware.twin.process import pack_status, unpack_status
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.world import TwinWorld
from tests.core.robots import THREE, TURNED

RIGS = sorted((RESOURCES / "rigs").glob("*.toml"))


def test_the_example_rigs_can_be_read() -> None:
    shapes = {path.stem: [joint.kind.value for joint in read_rig(path).servos.joints] for path in RIGS}
    assert shapes == {
        "three_tendons": ["tendon"] * 3 + ["advance", "delivery"],
        "two_tendons_rotation": ["tendon"] * 2 + ["advance", "rotation"],
    }


@pytest.mark.parametrize("servos", [THREE, TURNED, ServosConfig()], ids=["three", "two", "four"])
def test_taut_wires_bend_the_head_as_they_are_pulled_whatever_their_pretension(servos: ServosConfig) -> None:
    ways = [math.radians(joint.angle_deg or 0.0) for joint in servos.tendons]
    plane = ways[0] if len(ways) == 2 else 1.0
    pulls = [0.4 + 1.2 * math.cos(way - plane) for way in ways]
    wanted = (1.2 * math.cos(plane), 1.2 * math.sin(plane))
    assert wires_bend_mm(pulls, servos.tendons) == pytest.approx(wanted)


@pytest.mark.parametrize("plane_deg", [0.0, 50.0, 90.0, 200.0, 320.0])
def test_of_three_slack_wires_those_that_are_pulled_hold_the_head(plane_deg: float) -> None:
    """Where the pretension is just used up, both rules agree; then the head follows the pulled wires alone."""
    ways = [math.radians((joint.angle_deg or 0.0) - plane_deg) for joint in THREE.tendons]
    pulls = [1.2 * math.cos(way) for way in ways]
    assert wires_bend_mm([pull - 1e-9 for pull in pulls], THREE.tendons) == pytest.approx(bend_of(pulls, THREE.tendons), abs=1e-7)
    let_go = [pull - 0.5 for pull in pulls]
    bend = wires_bend_mm(let_go, THREE.tendons)
    taken = [bend[0] * way[0] + bend[1] * way[1] for way in map(direction, THREE.tendons)]
    assert all(took >= pull - 1e-9 for took, pull in zip(taken, let_go, strict=True)), "no wire is shorter than its way"
    assert min(took - pull for took, pull in zip(taken, let_go, strict=True)) == pytest.approx(0.0, abs=1e-9), "one is taut"
    assert 0.0 < math.hypot(*bend) < 1.2
    assert wires_bend_mm((-0.1, -0.2, -0.3), THREE.tendons) == (0.0, 0.0)


def test_joints_become_feed_and_turn_of_the_shaft() -> None:
    joints = JointsToTwin(TURNED, (0.3, 0.3, 0.0, 0.0))
    command = joints.command((1.3, -0.7, 0.4, 1.2), 0.02)
    assert (command.bend, command.pitch) == pytest.approx((0.0, 0.5)), "up, in the shaft's directions"
    assert (command.advance_mm_s, command.delivery_mm_s, command.rotation_deg_s) == pytest.approx((20.0, 0.0, 60.0))


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_the_head_goes_where_it_is_steered_on_the_screen(path: object) -> None:
    servos = next(read_rig(one).servos for one in RIGS if one == path)
    world = TwinWorld(TwinConfig(phantom="s_curve", image_width_px=160, image_height_px=120), servos=servos)
    world.insert(30.0)

    def heading_deg() -> float:
        before, end = world.physics.robot_points_mm()[-2:]
        return float(np.degrees(np.arctan2(end[1] - before[1], end[0] - before[0])))

    def turned_deg(bend: float) -> float:
        world.send(Command(bend=bend))
        world.advance(2.2)
        return heading_deg() - start_deg

    start_deg = heading_deg()
    assert turned_deg(0.3) == pytest.approx(22.0, abs=4.0), "as the default robot does"
    assert turned_deg(-0.3) == pytest.approx(-24.0, abs=4.0)
    assert turned_deg(0.0) == pytest.approx(0.0, abs=3.0)
    status = world.physics.status()
    assert len(status.tendon_pull_mm) == len(servos.tendons)
    assert status.rotation_deg == pytest.approx(90.0 if path.stem == "two_tendons_rotation" else 0.0, abs=0.01)
    assert unpack_status(pack_status(status)) == status


@pytest.mark.real_time
def test_the_real_driver_turns_a_shaft_and_the_wires_load_their_servos(start_servos: Callable[..., SoftServoBus]) -> None:
    servos = TURNED.model_copy(update={"watchdog_s": 2.0})
    twin = start_servos(servos, positions=[1000 + joint.id for joint in servos.joints])
    bus = ServoBus(servos, twin.port)
    try:
        bus.open()
        bus.set_zero()
        bus.arm()
        twin.set_loads_mn((100.0, 0.0, 0.0, 0.0))
        for turn in range(1, 11):
            written = bus.write((0.3, 0.3, 0.0, 0.5 * turn))
            readings = bus.read()
        assert [reading.name for reading in readings] == list(servos.names)
        assert written[3] == pytest.approx(5.0, abs=0.1), "degrees"
        turned = next(one for one in bus.read() if one.name == "rotation")
        assert turned.goal_mm == pytest.approx(5.0, abs=0.1)
    finally:
        bus.close()

"""The twin's mechanics: signs, limits, containment by the walls, determinism."""

from __future__ import annotations

import numpy as np
import pytest

from core.types import Command, GraphEdge, Points, VesselGraph
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import (
    MAX_PULL_MM,
    OUTSIDE_MM,
    ROBOT_RADIUS_MM,
    STEERABLE_MM,
    DriveProperties,
    TendonDrive,
    TwinPhysics,
    lumen_outline,
    wall_boxes,
)

TICK_S = 0.02


def channel(start: tuple[float, float], end: tuple[float, float], radius: float) -> Phantom:
    points = np.linspace(start, end, 1 + int(np.hypot(end[0] - start[0], end[1] - start[1]) / 0.4))
    edge = GraphEdge(0, 1, points, np.full(len(points), radius))
    return Phantom("channel", "straight channel", VesselGraph(points[[0, -1]], (edge,)), 0)


def heading_deg(points: Points) -> float:
    """Direction of the robot's last millimetre."""
    step = points[-1] - points[-4]
    return float(np.degrees(np.arctan2(step[1], step[0])))


@pytest.fixture(scope="module")
def wide() -> TwinPhysics:
    """A lumen so wide that the tip touches nothing."""
    return TwinPhysics(channel((-1, 75), (100, 75), 40.0))


@pytest.fixture
def inserted(wide: TwinPhysics) -> TwinPhysics:
    wide.reset()
    wide.step(Command(advance_mm_s=40.0), 1.5)
    wide.step(Command(), 0.1)
    return wide


def test_it_starts_with_the_nose_at_the_port(wide: TwinPhysics) -> None:
    wide.reset()
    assert wide.time_s == 0.0
    assert wide.insertion_mm == 0.0
    np.testing.assert_allclose(wide.head_mm, (-1.0 + ROBOT_RADIUS_MM, 75.0), atol=1e-6)
    points = wide.robot_points_mm()
    np.testing.assert_allclose(points[:, 1], 75.0, atol=1e-6)
    assert points[0, 0] <= -1.0 - OUTSIDE_MM + 1e-6
    assert wide.status().wall_contact_n == 0.0
    assert wide.contacts() == []


def test_simulated_time_follows_the_calls_without_drift(wide: TwinPhysics) -> None:
    wide.reset()
    for _ in range(30):
        wide.step(Command(), 1.0 / 30.0)
    assert wide.time_s == pytest.approx(1.0, abs=0.0011)


def test_advance_feeds_by_speed_times_time(inserted: TwinPhysics) -> None:
    assert inserted.insertion_mm == pytest.approx(60.0, abs=0.3)
    inserted.step(Command(advance_mm_s=-8.0), 1.0)
    inserted.step(Command(), 0.2)
    assert inserted.insertion_mm == pytest.approx(52.0, abs=0.3)
    np.testing.assert_allclose(inserted.head_mm, (-1.0 + inserted.insertion_mm + ROBOT_RADIUS_MM, 75.0), atol=0.05)


def test_the_tip_bends_about_47_degrees_per_millimetre(inserted: TwinPhysics) -> None:
    inserted.step(Command(bend=0.5), 0.6)
    pull = inserted.status().tendon_pull_mm
    assert pull[0] == pytest.approx(0.5 * MAX_PULL_MM, abs=0.25)
    assert heading_deg(inserted.robot_points_mm()) == pytest.approx(47.0, abs=4.0)


@pytest.mark.parametrize(("start", "end", "bend"), [((201, 75), (100, 75), 0.6), ((100, -1), (100, 100), -0.6)])
def test_positive_bend_goes_to_the_right_as_seen_on_screen(
    start: tuple[float, float], end: tuple[float, float], bend: float
) -> None:
    physics = TwinPhysics(channel(start, end, 40.0))
    physics.step(Command(advance_mm_s=40.0), 1.0)
    physics.step(Command(bend=bend), 0.4)
    dx, dy = (np.array(end) - start) / np.hypot(end[0] - start[0], end[1] - start[1])
    right = np.array([-dy, dx])
    sideways = (np.array(physics.head_mm) - start) @ right
    assert np.sign(sideways) == np.sign(bend)
    assert abs(sideways) > 3.0


def test_pitch_leaves_the_plane_and_pulls_the_vertical_tendons(inserted: TwinPhysics) -> None:
    inserted.step(Command(pitch=0.2), 0.4)
    right, left, up, down = inserted.status().tendon_force_mn
    assert up > 50.0
    np.testing.assert_allclose((right, left, down), 0.0, atol=5.0)
    assert heading_deg(inserted.robot_points_mm()) == pytest.approx(0.0, abs=0.5)


def test_only_the_pulled_tendon_carries_force(inserted: TwinPhysics) -> None:
    inserted.step(Command(bend=1.0), 0.6)
    right, left, _, _ = inserted.status().tendon_force_mn
    assert 400.0 < right < 800.0
    assert left == pytest.approx(0.0, abs=5.0)
    assert inserted.status().tendon_pull_mm[1] < -1.0


def test_insertion_ends_at_the_chain_and_the_robot_can_be_drawn_out_and_in_again() -> None:
    physics = TwinPhysics(channel((-1, 75), (60, 75), 5.0))
    physics.step(Command(bend=0.4, advance_mm_s=40.0), 4.0)
    assert 60.0 < physics.insertion_mm <= physics.chain_mm
    assert physics.status().wall_contact_n is not None and physics.status().wall_contact_n > 0.05
    assert not physics.is_drawn_out
    physics.step(Command(advance_mm_s=-40.0), 4.0)
    physics.step(Command(), 0.5)
    assert physics.is_drawn_out
    assert physics.insertion_mm == 0.0
    np.testing.assert_allclose(physics.robot_points_mm()[:, 1], 75.0, atol=0.1)
    assert physics.head_mm[0] < -1.0 - OUTSIDE_MM + ROBOT_RADIUS_MM
    assert physics.status().wall_contact_n == pytest.approx(0.0, abs=0.01)
    physics.step(Command(advance_mm_s=40.0), 1.8)
    assert physics.insertion_mm == pytest.approx(40.0, abs=1.0)


def test_a_stalled_feed_slips_instead_of_pushing_through() -> None:
    """A closed end: the drive's force is limited, so the insertion stays and backing out answers at once."""
    physics = TwinPhysics(channel((-1, 75), (40, 75), 4.0))
    physics.step(Command(advance_mm_s=20.0), 6.0)
    assert physics.clearance_mm() > -1.0
    stalled = physics.insertion_mm
    physics.step(Command(advance_mm_s=-20.0), 0.5)
    assert stalled - physics.insertion_mm > 8.0


def test_the_sheath_follows_but_never_covers_the_steerable_part(inserted: TwinPhysics) -> None:
    inserted.step(Command(delivery_mm_s=100.0), 1.0)
    assert inserted.delivery_mm == pytest.approx(inserted.insertion_mm - STEERABLE_MM, abs=0.2)
    inserted.step(Command(advance_mm_s=-40.0), 0.75)
    assert inserted.delivery_mm <= inserted.insertion_mm - STEERABLE_MM + 0.2
    inserted.step(Command(delivery_mm_s=-100.0), 1.0)
    assert inserted.delivery_mm == 0.0


@pytest.mark.slow
def test_the_sheath_stiffens_what_it_covers() -> None:
    """Pushed against the same bend, the covered robot presses harder on the wall."""
    forces = []
    for delivery_mm_s in (0.0, 20.0):
        physics = TwinPhysics(make_phantom("s_curve"))
        physics.step(Command(advance_mm_s=40.0), 3.2)
        physics.step(Command(delivery_mm_s=delivery_mm_s), 5.0)
        forces.append(physics.status().wall_contact_n or 0.0)
    assert forces[1] > 1.5 * forces[0]


def test_contacts_lie_on_the_wall_and_add_up() -> None:
    physics = TwinPhysics(make_phantom("s_curve"))
    physics.step(Command(advance_mm_s=40.0), 2.5)
    physics.step(Command(), 1.0)
    contacts = physics.contacts()
    assert contacts
    outline = np.concatenate(lumen_outline(physics.phantom.graph))
    for point, force_mn in contacts:
        assert np.linalg.norm(outline - point, axis=1).min() < 0.6
        assert force_mn > 0.0
    total_n = sum(force for _, force in contacts) / 1000.0
    assert physics.status().wall_contact_n == pytest.approx(total_n, rel=0.3, abs=0.003)
    assert -0.6 < physics.clearance_mm() < 0.2


def test_the_same_commands_give_the_same_bits_and_reset_starts_afresh() -> None:
    """Long enough that the chain is swapped for a longer and again for a shorter one."""

    def drive(physics: TwinPhysics) -> bytes:
        trace = []
        rng = np.random.default_rng(5)
        for index in range(40):
            speed = 40.0 if index < 25 else -40.0
            physics.step(Command(bend=rng.uniform(-1, 1), pitch=rng.uniform(-0.2, 0.2), advance_mm_s=speed, delivery_mm_s=3.0), 0.1)
            trace.append(physics.robot_points_mm().tobytes() + repr(physics.status()).encode())
        return b"".join(trace)

    first = TwinPhysics(make_phantom("tree"), seed=3)
    once = drive(first)
    first.reset()
    assert drive(first) == once
    assert drive(TwinPhysics(make_phantom("tree"), seed=4)) != once


@pytest.mark.parametrize("name", ["cerebral_siphon", "random:14"])
def test_random_commands_never_break_it(name: str) -> None:
    physics, rng = TwinPhysics(make_phantom(name), seed=1), np.random.default_rng(11)
    for _ in range(20):
        speed = float(rng.choice([40.0, 40.0, 20.0, -20.0]))
        command = Command(rng.uniform(-1, 1), rng.uniform(-1, 1), speed, rng.uniform(-10, 10))
        for _ in range(10):
            physics.step(command, TICK_S)
            points = physics.robot_points_mm()
            assert np.isfinite(points).all()
            assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 4.0
            assert physics.clearance_mm() > -ROBOT_RADIUS_MM
            assert 0.0 <= physics.insertion_mm <= physics.chain_mm


@pytest.mark.parametrize("name", ["loop", "tree"])
def test_walls_line_the_lumen_and_leave_the_port_open(name: str) -> None:
    phantom = make_phantom(name)
    outlines = lumen_outline(phantom.graph)
    walls, port = wall_boxes(phantom, outlines)
    outline = np.concatenate(outlines)
    across = np.array([(-np.sin(wall.angle_rad), np.cos(wall.angle_rad)) for wall in walls])
    centers = np.array([(wall.x, wall.y) for wall in walls])
    half = np.array([wall.half_thickness for wall in walls])[:, None]
    faces = np.minimum(
        *(np.linalg.norm(outline[None] - (centers + side * half * across)[:, None], axis=2).min(axis=1) for side in (1.0, -1.0))
    )
    assert faces.max() < 0.25
    behind = (centers - port.point) @ port.inward
    assert behind.min() > -1.0
    # Together they are about as long as the outline, less the mouth.
    length = sum(2 * wall.half_length for wall in walls)
    steps = [np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in lumen_outline(phantom.graph)]
    assert sum(steps) - 6 * port.radius < length < sum(steps)


def test_the_drive_slews_and_has_play() -> None:
    drive = TendonDrive(DriveProperties(slew_mm_s=10.0, backlash_mm=0.1, dead_zone_mm=0.02))
    assert drive.step(1.0, 0.1) == pytest.approx(1.0 - 0.05 - 0.02)
    assert drive.step(1.0, 1.0) == pytest.approx(MAX_PULL_MM - 0.05 - 0.02)
    # The way back starts only when the play is taken up.
    assert drive.step((MAX_PULL_MM - 0.1) / MAX_PULL_MM, 1.0) == pytest.approx(MAX_PULL_MM - 0.05 - 0.02)
    assert drive.step(0.0, 1.0) == pytest.approx(0.05 - 0.02)
    assert drive.step(7.0, 1.0) == pytest.approx(MAX_PULL_MM - 0.05 - 0.02)


def test_each_side_has_its_slack_and_its_gain() -> None:
    drive = TendonDrive(DriveProperties(backlash_mm=0.0, dead_zone_mm=0.1, dead_zone_left_mm=0.2, gain=(1.5, 0.5)))
    assert drive.step(0.5, 1.0) == pytest.approx(1.5 * (1.0 - 0.1))
    assert drive.step(-0.5, 1.0) == pytest.approx(-0.5 * (1.0 - 0.2))


def test_feed_and_delay_of_another_robot() -> None:
    robot = DriveProperties(feed_share=1.2, feed_slip=0.25, delay_s=0.1)
    physics = TwinPhysics(channel((-1, 75), (100, 75), 40.0), drive=robot)
    physics.step(Command(advance_mm_s=20.0), 0.1)
    assert physics.insertion_mm == 0.0
    physics.step(Command(advance_mm_s=20.0), 0.9)
    physics.step(Command(), 0.5)
    assert physics.insertion_mm == pytest.approx(20.0 * 1.2 * 0.75, abs=0.05)
    physics.step(Command(advance_mm_s=-10.0), 1.0)
    physics.step(Command(), 0.5)
    assert physics.insertion_mm == pytest.approx(20.0 * 1.2 * 0.75 - 12.0, abs=0.05)


def test_a_controller_on_the_true_centerline_reaches_the_tree() -> None:
    """10 mm look-ahead, 20 mm/s, into the end that asks for two turns."""
    phantom = make_phantom("tree")
    target = max(phantom.targets, key=lambda node: phantom.graph.nodes[node][1])
    edges = {(edge.start, edge.end): edge.points for edge in phantom.graph.edges}
    route, node = [], target
    while node != phantom.port:
        start, end = next(key for key in edges if key[1] == node)
        route.insert(0, edges[start, end])
        node = start
    way = np.concatenate(route)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    physics, beside_mm = TwinPhysics(phantom), 0.0
    goal = phantom.graph.nodes[target]
    # Not by progress along the route: a head in a sibling branch lies beside its end, too.
    while np.linalg.norm(goal - physics.head_mm) > 5.0 and physics.time_s < 12.0:
        points = physics.robot_points_mm()
        near = np.flatnonzero(np.abs(along - beside_mm) < 20.0)
        beside_mm = float(along[near[np.argmin(np.linalg.norm(way[near] - points[-1], axis=1))]])
        wanted = way[min(int(np.searchsorted(along, beside_mm + 10.0)), len(way) - 1)] - points[-1]
        heading = points[-1] - points[-10]
        turn = np.arctan2(heading[0] * wanted[1] - heading[1] * wanted[0], heading @ wanted)
        physics.step(Command(bend=float(np.clip(1.6 * turn, -1, 1)), advance_mm_s=20.0), TICK_S)
    assert np.linalg.norm(goal - physics.head_mm) <= 5.0
    assert (physics.status().wall_contact_n or 0.0) < 1.0

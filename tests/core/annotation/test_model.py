"""What is measured from drawn lines, edits of points, and undo as a journal that only grows."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from core.annotation.model import (
    FOLLOWS_LINES,
    ROBOT,
    TAKES_LINES,
    VESSEL,
    AngleProvenance,
    Annotation,
    History,
    ImageView,
    JournalEntry,
    MaskPolygon,
    MaskTarget,
    Status,
    Touch,
    annotation_from_json,
    line_of,
    measure_lines,
    move,
    put,
    remove,
    status_of,
    touched,
    turn_annotation,
    turn_image,
    turn_point,
    with_line,
    working_scale,
)
from core.config.models import PerceptionConfig
from core.types import PoseState

CONFIG = PerceptionConfig()
SIZE = (640, 480)


def test_a_robot_30_degrees_to_the_right_of_a_level_vessel() -> None:
    """Head at (300, 200), its 40 px come from 30 degrees above; the vessel's line is y = 210, drawn from left to right."""
    tail = (300.0 - 100.0 * math.cos(math.radians(30)), 200.0 - 100.0 * math.sin(math.radians(30)))
    found = measure_lines(Annotation(robot=(tail, (300.0, 200.0)), vessel=((200.0, 210.0), (400.0, 210.0))), SIZE, CONFIG)
    assert found.pose.theta_deg == pytest.approx(30.0)
    assert found.pose.theta_signed_deg == pytest.approx(30.0), "downwards is to the right on a screen"
    assert found.pose.d_head_px == pytest.approx(10.0)
    assert found.pose.d_tail_px == pytest.approx(10.0 + 20.0), "40 px back along 30 degrees is 20 px higher"
    assert not found.pose.crossed
    assert found.pose.state is PoseState.B
    assert (found.robot_length_px, found.vessel_length_px) == (pytest.approx(40.0), pytest.approx(40.0))


def test_the_vessels_direction_is_the_robots_however_it_was_drawn() -> None:
    robot = ((200.0, 200.0), (300.0, 210.0))
    forth = measure_lines(Annotation(robot, ((200.0, 220.0), (400.0, 220.0))), SIZE, CONFIG).pose
    back = measure_lines(Annotation(robot, ((400.0, 220.0), (200.0, 220.0))), SIZE, CONFIG).pose
    assert forth.theta_signed_deg == pytest.approx(back.theta_signed_deg) == pytest.approx(math.degrees(math.atan2(10, 100)))


@pytest.mark.parametrize(
    ("robot", "state", "crossed"),
    [
        (((260.0, 202.0), (300.0, 204.0)), PoseState.A, False),  # 2 and 4 px, 2.9 degrees
        (((260.0, 190.0), (300.0, 210.0)), PoseState.D, True),  # from 10 px above to 10 px below
        (((260.0, 230.0), (300.0, 215.0)), PoseState.B, False),  # from 30 to 15 px
        (((260.0, 215.0), (300.0, 230.0)), PoseState.C, False),  # from 15 to 30 px
    ],
)
def test_states_by_the_rule(robot: tuple[tuple[float, float], ...], state: PoseState, crossed: bool) -> None:
    pose = measure_lines(Annotation(robot, ((200.0, 200.0), (400.0, 200.0))), SIZE, CONFIG).pose
    assert (pose.state, pose.crossed) == (state, crossed)


def test_a_picture_of_twice_the_size_measures_the_same() -> None:
    """All lengths are working pixels: the longer side scaled to 640. A source pixel (x, y) lies at (x + 0.5) / 2 - 0.5 there."""
    small = Annotation(((220.0, 180.0), (300.0, 200.0)), ((200.0, 215.0), (400.0, 205.0)))
    large = Annotation(*(tuple((2 * x + 0.5, 2 * y + 0.5) for x, y in line) for line in (small.robot, small.vessel)))
    first, second = measure_lines(small, (640, 480), CONFIG), measure_lines(large, (1280, 960), CONFIG)
    assert second.pose.theta_deg == pytest.approx(first.pose.theta_deg)
    assert second.pose.d_head_px == pytest.approx(first.pose.d_head_px)
    assert second.robot_vector.end == pytest.approx((600.5, 400.5)), "but points are source pixels"
    assert working_scale((1280, 960), 640) == (0.5, 0.5)


@pytest.mark.parametrize("line", [(), ((5.0, 5.0),), ((5.0, 5.0), (5.0, 5.0)), ((5.0, 5.0), (7.0, 5.0))])
def test_no_line_no_angle(line: tuple[tuple[float, float], ...]) -> None:
    found = measure_lines(Annotation(line, line), SIZE, CONFIG)
    assert found.pose is None
    assert found.missing


@pytest.mark.parametrize("view", list(ImageView))
def test_a_view_is_its_own_inverse_and_keeps_the_measures(view: ImageView) -> None:
    drawn = Annotation(((220.0, 180.0), (300.0, 200.0)), ((200.0, 215.0), (400.0, 205.0)), masks=(_triangle(),))
    shown = turn_annotation(drawn, view, SIZE)
    assert turn_annotation(shown, view, SIZE) == drawn
    first, second = (measure_lines(one, SIZE, CONFIG).pose for one in (drawn, shown))
    assert second.theta_deg == pytest.approx(first.theta_deg)
    assert (second.d_head_px, second.state) == (pytest.approx(first.d_head_px), first.state)


def test_points_and_pixels_turn_alike() -> None:
    image = np.zeros((48, 64, 3), np.uint8)
    image[7, 11] = 255
    for view in ImageView:
        x, y = turn_point((11.0, 7.0), view, (64, 48))
        assert turn_image(image, view)[round(y), round(x)].tolist() == [255, 255, 255]


def _triangle() -> MaskPolygon:
    return MaskPolygon(MaskTarget.ROBOT, ((1.0, 1.0), (9.0, 1.0), (1.0, 9.0)), is_hole=True)


def test_json_keeps_everything() -> None:
    full = Annotation(((1.5, 2.0), (3.0, 4.25)), ((0.0, 0.0),), PoseState.C, False, (_triangle(),), "head – „blurred“")
    assert annotation_from_json(full.to_json()) == full
    assert annotation_from_json(Annotation().to_json()) == Annotation()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        "[" * 100_000,
        Annotation().to_json().replace('"robot":[]', '"robot":[[1,NaN]]'),
        Annotation().to_json().replace('"robot":[]', '"robot":[[1,2,3]]'),
        Annotation().to_json().replace('"robot":[]', '"robot":[[1,1e99]]'),
        Annotation().to_json().replace('"state":null', '"state":"E"'),
        Annotation().to_json().replace('"masks":[]', '"masks":[{"target":"bone","points":[],"is_hole":false}]'),
    ],
)
def test_damaged_json_is_an_error(text: str) -> None:
    with pytest.raises(ValueError):
        annotation_from_json(text)


def test_status() -> None:
    lines = Annotation(((1.0, 1.0),))
    assert status_of(None, measured=False) is Status.NEW
    assert status_of(Annotation(), measured=False) is Status.NEW
    assert status_of(lines, measured=False) is Status.BEGUN
    assert status_of(Annotation(state=PoseState.A), measured=True) is Status.DONE
    assert status_of(Annotation(cannot_tell=True), measured=False) is Status.CANNOT_TELL
    assert status_of(Annotation(no_robot=True), measured=False) is Status.NO_ROBOT


def test_where_lines_come_from_follows_undo_and_ends_with_cleared_lines() -> None:
    taken = Annotation(((1.0, 1.0), (50.0, 1.0)), ((1.0, 5.0), (60.0, 5.0)))
    history = History()
    history.edit("add a point", Annotation(taken.robot))
    assert history.provenance is AngleProvenance.MANUAL
    history.edit(TAKES_LINES, taken)
    history.edit("state B", replace(taken, state=PoseState.B))
    assert history.provenance is AngleProvenance.ALGORITHM
    history.edit("move a point", move(taken, ROBOT, 0, (2.0, 2.0)))
    assert history.provenance is AngleProvenance.CORRECTED
    history.undo()
    assert history.provenance is AngleProvenance.ALGORITHM
    history.edit("clear the robot line", Annotation())
    history.edit("add a point", Annotation(taken.robot))
    assert history.provenance is AngleProvenance.MANUAL
    history.edit(FOLLOWS_LINES, taken)
    assert history.provenance is AngleProvenance.FOLLOWED


@pytest.mark.parametrize(("robot_px", "vessel_px", "is_short"), [(60.0, 60.0, False), (39.7, 60.0, False), (39.0, 60.0, True)])
def test_lines_shorter_than_the_fit_wants_are_known(robot_px: float, vessel_px: float, is_short: bool) -> None:
    lines = Annotation(((300.0 - robot_px, 200.0), (300.0, 200.0)), ((300.0 - vessel_px, 210.0), (300.0 + vessel_px, 210.0)))
    assert measure_lines(lines, (640, 640), PerceptionConfig()).is_short is is_short


VESSEL_BOX = MaskPolygon(MaskTarget.VESSEL, ((10.0, 10.0), (50.0, 10.0), (50.0, 30.0), (10.0, 30.0)))
ROBOT_BOX = MaskPolygon(MaskTarget.ROBOT, ((20.0, 18.0), (40.0, 18.0), (40.0, 22.0), (20.0, 22.0)))


def with_masks(*masks: MaskPolygon) -> Annotation:
    return Annotation(((10.0, 20.0), (50.0, 20.0)), ((12.0, 24.0), (60.0, 24.0)), PoseState.B, masks=masks)


def test_edits_of_points() -> None:
    drawn = with_masks(VESSEL_BOX)
    assert line_of(put(drawn, ROBOT, 1, (30.0, 20.0)), ROBOT) == ((10.0, 20.0), (30.0, 20.0), (50.0, 20.0))
    assert line_of(move(drawn, VESSEL, 0, (1.0, 2.0)), VESSEL)[0] == (1.0, 2.0)
    assert len(line_of(remove(drawn, 0, 3), 0)) == 3
    assert remove(remove(drawn, 0, 3), 0, 0).masks == (), "two points are no outline"
    assert not put(Annotation(cannot_tell=True), ROBOT, 0, (1.0, 1.0)).cannot_tell


def test_with_an_outline_its_holes_go() -> None:
    """They stayed, were shown as masks, and a robot's mask of nothing was exported."""
    hole = MaskPolygon(MaskTarget.ROBOT, ((28.0, 19.0), (32.0, 19.0), (32.0, 21.0)), is_hole=True)
    in_vessel = MaskPolygon(MaskTarget.VESSEL, hole.points, is_hole=True)
    drawn = with_masks(ROBOT_BOX, hole, VESSEL_BOX, in_vessel, hole, ROBOT_BOX, hole)
    assert with_line(drawn, 0, ()).masks == (VESSEL_BOX, in_vessel, ROBOT_BOX, hole), "up to the next outline of the same mask"
    assert with_line(drawn, 1, ()).masks == (ROBOT_BOX, VESSEL_BOX, in_vessel, hole, ROBOT_BOX, hole), "a hole goes alone"
    assert remove(drawn, 0, 1).masks[1:] == drawn.masks[1:], "an outline with a point less is one still"


def test_what_a_place_touches() -> None:
    drawn = with_masks(VESSEL_BOX)
    assert touched(drawn, [ROBOT, VESSEL], (49.0, 21.0), 3.0, 2.0) == Touch(ROBOT, 1)
    assert touched(drawn, [ROBOT, VESSEL], (30.0, 21.0), 3.0, 2.0) == Touch(ROBOT, 1, is_edge=True)
    assert touched(drawn, [VESSEL], (30.0, 21.0), 3.0, 2.0) is None
    assert touched(drawn, [0], (10.0, 20.0), 3.0, 2.0) == Touch(0, 4, is_edge=True), "an outline is closed"
    assert touched(drawn, [], (10.0, 10.0), 3.0, 2.0) is None


def step(number: int) -> Annotation:
    return Annotation(((float(number), 0.0),))


def test_undo_goes_back_to_the_beginning_and_redo_to_the_end() -> None:
    history = History()
    for number in range(1, 200):
        history.edit(f"edit {number}", step(number))
    assert history.undo_action == "edit 199"
    while history.undo() is not None:
        pass
    assert history.current == Annotation()
    assert not history.can_undo
    while history.redo() is not None:
        pass
    assert history.current == step(199)


def test_an_edit_after_an_undo_ends_redo_but_the_journal_keeps_what_was_undone() -> None:
    history = History()
    entries = [history.edit("one", step(1)), history.edit("two", step(2)), history.undo(), history.edit("three", step(3))]
    assert not history.can_redo
    assert [entry.number for entry in entries if entry is not None] == [1, 2, 3, 4]
    assert entries[1].content == step(2)
    history.undo()
    assert history.current == step(1)
    history.redo()
    assert history.current == step(3)


def test_the_journal_brings_everything_back() -> None:
    """Whatever a rater did: a history that follows its journal stands where the first one stands, and undoes the same."""
    rng = random.Random(5)
    for _ in range(60):
        history, journal = History(), []
        for number in range(rng.randrange(1, 40)):
            entry = rng.choice((lambda: history.edit("edit", step(number)), history.undo, history.redo))()  # noqa: B023
            journal += [entry] if entry is not None else []
        again = History(journal)
        assert (again.current, again.can_undo, again.can_redo) == (history.current, history.can_undo, history.can_redo)
        while history.undo() is not None:
            again.undo()
            assert again.current == history.current


def test_a_journal_with_holes_and_nonsense_is_followed_as_far_as_it_goes() -> None:
    history = History()
    first, _, third = history.edit("one", step(1)), history.edit("two", step(2)), history.edit("three", step(3))
    nonsense = [JournalEntry(4, "undo", 77), JournalEntry(5, "redo", 9), JournalEntry(6, "edit", 6, "loop", step(6)), first]
    again = History([first, third, *nonsense])
    assert again.current == step(3)
    again.undo()
    assert again.current == step(1), "the lost edit is stepped over"

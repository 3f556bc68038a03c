"""The rater's hand: lines grow and end, points are moved and taken out, outlines are drawn, painted and simplified."""

from __future__ import annotations

import pytest

from app.annotator.editing import AnnotationEditor, Reach, Tool
from core.annotation.model import ROBOT, VESSEL, Annotation, MaskPolygon, MaskTarget, Readout, Touch, measure_lines
from core.config.models import PerceptionConfig
from core.types import Point

SIZE = (640, 480)
REACH = Reach(8.0, 5.0)
BOX = MaskPolygon(MaskTarget.VESSEL, ((100.0, 100.0), (200.0, 100.0), (200.0, 200.0), (100.0, 200.0)))


def measure(annotation: Annotation) -> Readout:
    return measure_lines(annotation, SIZE, PerceptionConfig())


@pytest.fixture
def hand() -> AnnotationEditor:
    made = AnnotationEditor()
    made.take_image(SIZE, Annotation(), measure)
    return made


def click(hand: AnnotationEditor, point: Point) -> None:
    hand.press(point, REACH)
    hand.release()


def test_clicks_make_a_line_until_enter_ends_it(hand: AnnotationEditor) -> None:
    for point in ((100.0, 100.0), (150.0, 110.0)):
        click(hand, point)
    assert hand.end().tool is Tool.ROBOT
    assert hand.press((300.0, 300.0), REACH) is False, "ended: an empty place sets no point"
    assert hand.annotation.robot == ((100.0, 100.0), (150.0, 110.0))
    assert hand.end() == type(hand.end())(), "nothing more to end"


def test_one_point_is_no_line_to_end(hand: AnnotationEditor) -> None:
    click(hand, (100.0, 100.0))
    assert hand.end().tool is None


def test_the_same_tool_again_opens_the_line_at_its_nearer_end(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(robot=((100.0, 100.0), (150.0, 100.0))), measure)
    hand.take_tool(Tool.ROBOT)
    click(hand, (50.0, 100.0))
    click(hand, (200.0, 100.0))
    assert hand.annotation.robot == ((50.0, 100.0), (100.0, 100.0), (150.0, 100.0), (200.0, 100.0))


def test_the_line_reaches_to_the_cursor_while_it_is_drawn(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(vessel=((200.0, 100.0), (400.0, 100.0))), measure)
    click(hand, (240.0, 100.0))
    assert hand.stretch((300.0, 100.0), REACH)
    pose = hand.drawing.readout.pose
    assert pose is not None
    assert pose.theta_deg == pytest.approx(0.0)
    assert hand.annotation.robot == ((240.0, 100.0),), "nothing is drawn yet"
    assert hand.unstretch()
    assert hand.drawing.readout.pose is None


def test_a_point_is_dragged_without_a_jump(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(robot=((100.0, 100.0), (150.0, 100.0))), measure)
    hand.press((153.0, 102.0), REACH)
    hand.drag_to((163.0, 112.0))
    assert hand.release() == ("move a point", Annotation(robot=((100.0, 100.0), (160.0, 110.0))))
    assert hand.drawing.selected == Touch(ROBOT, 1)


def test_a_click_on_the_line_puts_a_point_in(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(robot=((100.0, 100.0), (150.0, 100.0))), measure)
    hand.press((125.0, 102.0), REACH)
    edit = hand.release()
    assert edit is not None
    assert edit[1].robot == ((100.0, 100.0), (125.0, 102.0), (150.0, 100.0))


def test_points_of_the_other_line_can_be_taken_hold_of_when_nothing_is_drawn(hand: AnnotationEditor) -> None:
    both = Annotation(((100.0, 100.0), (150.0, 100.0)), ((100.0, 120.0), (180.0, 120.0)))
    hand.take_image(SIZE, both, measure)
    hand.press((180.0, 120.0), REACH)
    assert hand.tool is Tool.VESSEL
    assert hand.drawing.selected == Touch(VESSEL, 1)


def test_while_a_line_is_drawn_the_other_one_is_not_in_the_way(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(vessel=((100.0, 120.0), (180.0, 120.0))), measure)
    click(hand, (180.0, 120.0))
    assert hand.annotation.robot == ((180.0, 120.0),)


def test_nudges_stay_on_the_image(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(robot=((5.0, 5.0), (100.0, 100.0))), measure)
    assert hand.nudge(1.0, 0.0) is None, "nothing is selected"
    assert hand.select_next(1) == (100.0, 100.0), "the head first"
    hand.nudge(0.1, 0.0)
    assert hand.annotation.robot[1] == (100.1, 100.0)
    assert hand.select_next(1) == (5.0, 5.0)
    hand.nudge(-10.0, -10.0)
    assert hand.annotation.robot[0] == (-0.5, -0.5)


def test_delete_and_clear(hand: AnnotationEditor) -> None:
    line = ((100.0, 100.0), (150.0, 100.0), (200.0, 100.0))
    hand.take_image(SIZE, Annotation(robot=line, masks=(BOX,)), measure)
    hand.delete()
    assert hand.annotation.robot == line[:2], "without a selection the last point goes"
    hand.select_next(-1)
    hand.delete()
    assert hand.annotation.robot == line[1:2]
    assert hand.clear() == ("clear the robot line", Annotation(masks=(BOX,)))
    hand.take_tool(Tool.VESSEL_MASK)
    assert hand.clear() is None, "no outline is selected"
    hand.select_next(1)
    assert hand.clear() == ("clear the outline", Annotation())


def test_escape_drops_what_is_under_way(hand: AnnotationEditor) -> None:
    hand.take_tool(Tool.ROBOT_MASK)
    click(hand, (10.0, 10.0))
    assert hand.let_go()
    assert not hand.let_go()
    assert hand.annotation == Annotation()


def test_an_outline_of_three_clicks(hand: AnnotationEditor) -> None:
    hand.take_tool(Tool.ROBOT_MASK)
    corners = ((10.0, 10.0), (60.0, 10.0), (10.0, 60.0))
    for corner in corners:
        click(hand, corner)
    ending = hand.end()
    assert ending.edit == ("draw robot mask", Annotation(masks=(MaskPolygon(MaskTarget.ROBOT, corners),)))


def test_the_brush_paints_and_takes_away(hand: AnnotationEditor) -> None:
    hand.take_image(SIZE, Annotation(masks=(BOX,)), measure)
    hand.take_tool(Tool.VESSEL_MASK)
    hand.begin_stroke((300.0, 300.0), erase=False)
    edit = hand.end_stroke(10.0)
    assert edit is not None
    assert len(edit[1].masks) == 2
    hand.begin_stroke((300.0, 300.0), erase=True)
    edit = hand.end_stroke(14.0)
    assert edit is not None
    assert [mask.target for mask in edit[1].masks] == [MaskTarget.VESSEL]


def test_hidden_masks_cannot_be_taken_hold_of(hand: AnnotationEditor) -> None:
    from dataclasses import replace

    hand.take_image(SIZE, Annotation(masks=(BOX,)), measure)
    hand.take_tool(Tool.VESSEL_MASK)
    assert hand.under((100.0, 100.0), REACH) == Touch(0, 0)
    hand.drawing = replace(hand.drawing, masks_shown=False)
    assert hand.under((100.0, 100.0), REACH) is None

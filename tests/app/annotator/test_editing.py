"""The annotation editor: lines grow and end, points are moved and removed, outlines are drawn, painted and simplified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.annotator.editing import RADIUS_NOTCH, AnnotationEditor, MaskMode, Tool
from core.annotation.model import ROBOT, VESSEL, Annotation, MaskPolygon, MaskTarget, Readout, Touch, measure_lines
from core.config.models import PerceptionConfig
from core.types import Point

SIZE = (640, 480)
SCALE = 0.8
"""Points can be grabbed within 8 px, edges within 4.8 px."""
BOX = MaskPolygon(MaskTarget.VESSEL, ((100.0, 100.0), (200.0, 100.0), (200.0, 200.0), (100.0, 200.0)))
LINE = ((100.0, 100.0), (150.0, 100.0))


def measure(annotation: Annotation) -> Readout:
    return measure_lines(annotation, SIZE, PerceptionConfig())


def editor(annotation: Annotation = Annotation()) -> AnnotationEditor:  # noqa: B008 - frozen
    made = AnnotationEditor()
    made.set_image(SIZE, annotation, measure)
    return made


def click(made: AnnotationEditor, *points: Point) -> None:
    for point in points:
        made.press(point, SCALE)
        made.release()


def test_clicks_make_a_line_until_enter_ends_it() -> None:
    made = editor()
    click(made, (100.0, 100.0))
    assert made.end() is None, "one point is no line"
    click(made, (150.0, 110.0))
    assert made.end() is Tool.ROBOT
    assert made.press((300.0, 300.0), SCALE) is False, "ended: an empty place sets no point"
    assert made.annotation.robot == ((100.0, 100.0), (150.0, 110.0))
    assert made.end() is None


def test_the_same_tool_again_reopens_the_line_at_its_nearer_end() -> None:
    made = editor(Annotation(robot=LINE))
    made.set_tool(Tool.ROBOT)
    click(made, (50.0, 100.0), (200.0, 100.0))
    assert made.annotation.robot == ((50.0, 100.0), *LINE, (200.0, 100.0))


def test_the_line_reaches_to_the_cursor_while_it_is_drawn() -> None:
    made = editor(Annotation(vessel=((200.0, 100.0), (400.0, 100.0))))
    click(made, (240.0, 100.0))
    assert made.stretch((300.0, 100.0), SCALE)
    pose = made.drawing.readout.pose
    assert pose.theta_deg == pytest.approx(0.0)
    assert made.annotation.robot == ((240.0, 100.0),), "nothing is drawn yet"
    assert made.unstretch()
    assert made.drawing.readout.pose is None


def test_points_are_dragged_without_a_jump_and_put_into_the_line() -> None:
    made = editor(Annotation(robot=LINE))
    made.press((153.0, 102.0), SCALE)
    made.drag_to((163.0, 112.0))
    assert made.release() == ("move a point", Annotation(robot=((100.0, 100.0), (160.0, 110.0))))
    assert made.drawing.selected == Touch(ROBOT, 1)
    made = editor(Annotation(robot=LINE))
    click(made, (125.0, 102.0))
    assert made.annotation.robot == ((100.0, 100.0), (125.0, 102.0), (150.0, 100.0))


def test_points_of_the_other_line_can_be_grabbed_unless_a_line_is_drawn() -> None:
    made = editor(Annotation(LINE, ((100.0, 120.0), (180.0, 120.0))))
    made.press((180.0, 120.0), SCALE)
    assert (made.tool, made.drawing.selected) == (Tool.VESSEL, Touch(VESSEL, 1))
    made = editor(Annotation(vessel=((100.0, 120.0), (180.0, 120.0))))
    click(made, (180.0, 120.0))
    assert made.annotation.robot == ((180.0, 120.0),)


def test_nudges_stay_on_the_image() -> None:
    made = editor(Annotation(robot=((5.0, 5.0), (100.0, 100.0))))
    assert made.nudge(1.0, 0.0) is None, "nothing is selected"
    assert made.select_next(1) == (100.0, 100.0), "the head first"
    made.nudge(0.1, 0.0)
    assert made.annotation.robot[1] == (100.1, 100.0)
    assert made.select_next(1) == (5.0, 5.0)
    made.nudge(-10.0, -10.0)
    assert made.annotation.robot[0] == (-0.5, -0.5)


def test_delete_and_clear() -> None:
    line = (*LINE, (200.0, 100.0))
    made = editor(Annotation(robot=line, masks=(BOX,)))
    made.delete()
    assert made.annotation.robot == line[:2], "without a selection the last point goes"
    made.select_next(-1)
    made.delete()
    assert made.annotation.robot == line[1:2]
    assert made.clear() == ("clear the robot line", Annotation(masks=(BOX,)))
    made.set_tool(Tool.VESSEL_MASK)
    assert made.clear() is None, "no outline is selected"
    made.select_next(1)
    assert made.clear() == ("clear the outline", Annotation())


def test_an_outline_of_three_clicks_and_one_that_is_cancelled() -> None:
    made, corners = editor(), ((10.0, 10.0), (60.0, 10.0), (10.0, 60.0))
    made.set_tool(Tool.ROBOT_MASK)
    click(made, corners[0])
    assert made.cancel()
    assert not made.cancel()
    assert made.annotation == Annotation()
    click(made, *corners)
    assert made.end() == ("draw robot mask", Annotation(masks=(MaskPolygon(MaskTarget.ROBOT, corners),)))


def test_the_brush_paints_and_erases() -> None:
    made = editor(Annotation(masks=(BOX,)))
    made.set_tool(Tool.VESSEL_MASK)
    for erase, radius_px, count in ((False, 10.0, 2), (True, 14.0, 1)):
        made.radius_px = radius_px
        made.begin_stroke((300.0, 300.0), erase=erase)
        edit = made.end_stroke()
        assert [mask.target for mask in edit[1].masks] == [MaskTarget.VESSEL] * count


def test_a_tube_is_as_wide_as_the_circle_was_along_the_way() -> None:
    made = editor()
    made.set_tool(Tool.VESSEL_MASK)
    made.begin_stroke((100.0, 100.0), erase=True)
    made.resize_circle(RADIUS_NOTCH)
    made.continue_stroke((200.0, 100.0))
    gesture = made.end_gesture(MaskMode.TUBE, np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    assert (gesture.action, gesture.erases) == ("take a tube from the vessel mask", True)
    assert gesture.radii == pytest.approx((6.0, 6.0 * RADIUS_NOTCH))
    assert gesture.change((BOX,)) != (BOX,) and not made.stroke


def test_a_region_is_that_of_the_press_and_a_line_tool_has_none() -> None:
    made = editor(Annotation(masks=(BOX,)))
    image = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    made.begin_stroke((300.0, 300.0), erase=False)
    assert made.end_gesture(MaskMode.REGION, image) is None
    made.set_tool(Tool.VESSEL_MASK)
    made.begin_stroke((300.0, 300.0), erase=False)
    made.continue_stroke((310.0, 300.0))
    gesture = made.end_gesture(MaskMode.REGION, image)
    assert gesture.stroke == ((300.0, 300.0),)
    edit = made.apply_masks(gesture.action, gesture.change(made.annotation.masks))
    assert edit[0] == "add a region to the vessel mask" and len(edit[1].masks) == 2


def test_the_circle_has_a_least_and_a_largest_size() -> None:
    made = editor()
    made.resize_circle(1e-9)
    assert made.radius_px == 0.5
    made.resize_circle(1e9)
    assert made.radius_px == 200.0


def test_hidden_masks_cannot_be_grabbed() -> None:
    made = editor(Annotation(masks=(BOX,)))
    made.set_tool(Tool.VESSEL_MASK)
    assert made.touch_at((100.0, 100.0), SCALE) == Touch(0, 0)
    made.drawing = replace(made.drawing, masks_shown=False)
    assert made.touch_at((100.0, 100.0), SCALE) is None

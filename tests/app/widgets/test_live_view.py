"""The live picture: marks at the right place, switchable, clicks in source pixels; the loupe keeps clear."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.ui import theme
from app.widgets.live_view import LiveView, LoupeCorner, _middle
from app.widgets.scene_overlay import Layer, RehearsalShapes
from core.types import (
    Advice,
    Frame,
    Masks,
    Points,
    RobotPath,
    Route,
    Scene,
    Speed,
)
from tests.app.fakes import FakeBench, make_scene
from tests.app.widgets.conftest import Own

ADVICE = Advice(Speed.SLOW, 3.0, 18.3, "coming back")


def test_ghost_is_drawn_only_with_advice_and_goes_with_the_scene(own: Own, bench: FakeBench) -> None:
    live = own(LiveView(), 640, 480, show=True)
    image, scene = bench.scene_at(0, 6.0)
    frame = Frame(0, 0.0, image)
    for layer in Layer:
        live.set_layer(layer, layer is Layer.GHOST)
    live.show_frame(frame, scene)
    QApplication.processEvents()  # what is drawn over a first picture comes a moment later
    bare = live.grab().toImage()
    live.show_frame(frame, scene, ADVICE)
    assert live.grab().toImage() != bare
    live.blank_overlays()
    assert live.grab().toImage() == bare
    live.show_frame(frame, scene, replace(ADVICE, advance_mm_s=math.nan))
    assert live.grab().toImage() == bare


CORNERS = [QRectF(300, 0, 100, 80), QRectF(0, 0, 100, 80), QRectF(300, 220, 100, 80), QRectF(0, 220, 100, 80)]
UPPER_RIGHT, UPPER_LEFT, LOWER_RIGHT, LOWER_LEFT = range(4)
MIDDLE = QPointF(200, 150)
STRIPS = [QRectF(12, 12, 376, 30), QRectF(12, 258, 376, 30)]


def crowd(*counts: int) -> Points:
    """So many places in each corner."""
    places = [corner.center().toTuple() for corner, count in zip(CORNERS, counts, strict=False) for _ in range(count)]
    return np.array(places).reshape(-1, 2)


@pytest.mark.parametrize(
    ("head", "target", "covers", "corner"),
    [
        (MIDDLE, None, [], UPPER_RIGHT),
        (QPointF(290, 70), None, [], LOWER_LEFT),
        (MIDDLE, QPointF(350, 40), [], LOWER_LEFT),
        (MIDDLE, None, [QRectF(12, 12, 360, 60)], LOWER_LEFT),
        (MIDDLE, None, STRIPS, UPPER_RIGHT),
        (QPointF(350, 40), None, STRIPS, LOWER_LEFT),
        (QPointF(350, 40), CORNERS[LOWER_LEFT].center(), STRIPS, LOWER_RIGHT),
    ],
    ids=["nothing", "head", "target", "alerts", "strips", "head and strips", "head, target and strips"],
)
def test_the_loupe_leaves_its_corner_only_for_what_must_be_seen(
    head: QPointF, target: QPointF | None, covers: list[QRectF], corner: int
) -> None:
    chosen = LoupeCorner()
    assert chosen.choose(CORNERS, MIDDLE, None, crowd()) == UPPER_RIGHT
    crowded = crowd(60, 50, 20, 10)
    assert chosen.choose(CORNERS, head, target, crowded, covers) == corner
    assert chosen.choose(CORNERS, MIDDLE, None, crowded) == corner, "it need not come back"


GREY = 90


def _show(view: LiveView, frame: Frame, scene: Scene, advice: Advice | None = None) -> None:
    """What is drawn over a first picture comes in the event loop's next turn."""
    view.show_frame(frame, scene, advice)
    QApplication.processEvents()


@pytest.fixture
def view(own: Own) -> LiveView:
    return own(LiveView(), 640, 480, show=True)


def blank_frame(width: int = 640, height: int = 480) -> Frame:
    return Frame(0, 0.0, np.full((height, width, 3), GREY, np.uint8))


def picture(view: LiveView) -> QImage:
    return view.grab().toImage()


def near(image: QImage, x: float, y: float, name: str, reach: int = 12) -> bool:
    """Whether a pixel of that colour lies within `reach` of a place."""
    wanted = QColor(name)
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            c = image.pixelColor(round(x) + dx, round(y) + dy)
            if abs(c.red() - wanted.red()) + abs(c.green() - wanted.green()) + abs(c.blue() - wanted.blue()) < 24:
                return True
    return False


def on_screen(view: LiveView, x: float, y: float) -> QPointF:
    """Source pixel -> pixel of the grabbed widget."""
    scene_point = view._box.mapViewToScene(QPointF(x + 0.5, y + 0.5))
    return QPointF(view._view.mapFromScene(scene_point))


def head_scene(size: tuple[int, int], scale: float, head: tuple[float, float]) -> Scene:
    points = np.array([[head[0] - 60.0, head[1]], [head[0], head[1]]])
    path = RobotPath(points, 1.0, None, True, 0.0, 4.0)
    return replace(make_scene(), source_size=size, scale=scale, path=path)


@pytest.mark.parametrize(("size", "scale"), [((640, 480), 1.0), ((1280, 960), 0.5)])
def test_a_click_in_the_loupe_is_one_on_what_it_shows(view: LiveView, qtbot: QtBot, size: tuple[int, int], scale: float) -> None:
    """And not on what it hides."""
    scene = head_scene(size, scale, (400.0, 350.0))
    _show(view, blank_frame(*size), scene)
    view._show_loupe()
    loupe = view._loupe
    assert loupe.isVisible()
    clicked: list[tuple[float, float]] = []
    view.clicked.connect(lambda x, y: clicked.append((x, y)))
    middle = loupe.rect().center()
    qtbot.mouseClick(loupe, Qt.MouseButton.LeftButton, pos=middle)
    qtbot.mouseClick(loupe, Qt.MouseButton.LeftButton, pos=QPoint(middle.x() + loupe.width() // 4, middle.y()))
    middle_of_both = _middle(scene)
    assert middle_of_both is not None
    assert clicked[0] == pytest.approx(middle_of_both, abs=1.0 / scale)
    assert clicked[1][0] - clicked[0][0] == pytest.approx(110.0 / scale / 4, rel=0.03)


@pytest.mark.parametrize(("size", "scale"), [((640, 480), 1.0), ((1280, 960), 0.5), ((320, 240), 2.0), ((640, 360), 1.0)])
def test_head_is_drawn_where_it_is_in_the_source(view: LiveView, size: tuple[int, int], scale: float) -> None:
    scene = head_scene(size, scale, (400.0, 150.0))
    _show(view, blank_frame(*size), scene)
    at = on_screen(view, *scene.to_source((400.0, 150.0)))
    image = picture(view)
    assert near(image, at.x(), at.y(), theme.HEAD)
    assert not near(image, at.x() + 80, at.y() + 80, theme.HEAD)


def test_the_marks_follow_a_zoom_and_a_new_size(view: LiveView) -> None:
    scene = head_scene((640, 480), 1.0, (400.0, 150.0))
    _show(view, blank_frame(), scene)
    before = on_screen(view, 400.0, 150.0)
    view._box.setRange(xRange=(300, 500), yRange=(75, 225), padding=0)
    at = on_screen(view, 400.0, 150.0)
    assert (at - before).manhattanLength() > 50
    assert near(picture(view), at.x(), at.y(), theme.HEAD)
    assert not near(picture(view), before.x(), before.y(), theme.HEAD)
    view.fit()
    view.resize(900, 500)
    at = on_screen(view, 400.0, 150.0)
    assert near(picture(view), at.x(), at.y(), theme.HEAD)


def test_picture_keeps_its_aspect_and_is_shown_whole(view: LiveView) -> None:
    _show(view, blank_frame(640, 360), make_scene())
    image = picture(view)
    assert image.pixelColor(320, 240).red() == GREY
    assert image.pixelColor(320, 20).name().upper() == theme.INK, "bars above and below"
    assert image.pixelColor(2, 240).red() == GREY


def test_masks_tint_the_picture_and_can_be_switched_off(view: LiveView) -> None:
    vessel = np.zeros((480, 640), bool)
    vessel[100:300, 100:500] = True
    robot = np.zeros_like(vessel)
    robot[190:210, 100:400] = True
    masks = Masks(vessel, robot, vessel.astype(np.float32), robot.astype(np.float32))
    _show(view, blank_frame(), replace(make_scene(), masks=masks))
    image = picture(view)
    outside, lumen, device = (image.pixelColor(*place) for place in ((550, 400), (450, 150), (300, 200)))
    assert (outside.red(), outside.blue()) == (GREY, GREY)
    assert lumen.blue() > lumen.red() + 15, "blue for the vessel"
    assert device.red() > device.blue() + 40, "orange for the robot"
    view.set_layer(Layer.MASKS, False)
    assert picture(view).pixelColor(450, 150).blue() == GREY


@pytest.mark.parametrize("layer", list(Layer))
def test_each_layer_draws_something_and_nothing_when_off(view: LiveView, bench: FakeBench, layer: Layer) -> None:
    image, scene = bench.scene_at(0, 6.0)
    scene = replace(scene, route=Route(bench._line[300:], 300.0, (560.0, 300.0)))
    frame = Frame(0, 0.0, image)
    for other in Layer:
        view.set_layer(other, False)
    _show(view, frame, scene, Advice(Speed.FAST, 8.0, 20.0, ""))
    low, high = (np.array([(100.0, y), (300.0, y)]) for y in (200.0, 220.0))
    view.show_rehearsal(RehearsalShapes(low, high, (("#D55E00", (low,)),), (((200.0, 210.0), "weakest"),)))
    bare = picture(view)
    view.set_layer(layer, True)
    assert picture(view) != bare
    view.set_layer(layer, False)
    assert picture(view) == bare


def test_stale_overlays_go_away_the_picture_stays(view: LiveView, bench: FakeBench) -> None:
    image, scene = bench.scene_at(0, 6.0)
    _show(view, Frame(0, 0.0, image), scene)
    for layer in Layer:
        view.set_layer(layer, False)
    bare = picture(view)
    for layer in Layer:
        view.set_layer(layer, True)
    view.blank_overlays()
    assert view.scene is None
    assert picture(view) == bare


def test_click_gives_source_pixels(view: LiveView, qtbot: QtBot) -> None:
    _show(view, blank_frame(1280, 960), replace(make_scene(), source_size=(1280, 960), scale=0.5))
    at = on_screen(view, 800.0, 300.0).toPoint()
    with qtbot.waitSignal(view.clicked) as signal:
        qtbot.mouseClick(view._view.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert signal.args == pytest.approx([800.0, 300.0], abs=1.5)


def test_a_click_beside_the_picture_is_no_target_and_a_right_click_clears(view: LiveView, qtbot: QtBot) -> None:
    _show(view, blank_frame(640, 240), make_scene())
    clicked: list[tuple[float, float]] = []
    view.clicked.connect(lambda x, y: clicked.append((x, y)))
    qtbot.mouseClick(view._view.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(320, 10))
    with qtbot.waitSignal(view.cleared):
        qtbot.mouseClick(view._view.viewport(), Qt.MouseButton.RightButton, pos=QPoint(320, 240))
    assert clicked == []


def test_a_double_click_means_one_place_and_none_where_it_began_elsewhere(view: LiveView, qtbot: QtBot) -> None:
    """Who double-clicks an alert or an offer away clicks the second time on the picture that lay behind it."""
    _show(view, blank_frame(1280, 960), replace(make_scene(), source_size=(1280, 960), scale=0.5))
    at, viewport = on_screen(view, 800.0, 300.0).toPoint(), view._view.viewport()
    places: list[tuple[float, float]] = []
    view.clicked.connect(lambda x, y: places.append((x, y)))
    qtbot.mouseClick(viewport, Qt.MouseButton.LeftButton, pos=at)
    qtbot.mouseDClick(viewport, Qt.MouseButton.LeftButton, pos=at)
    qtbot.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=at)
    assert len(places) == 1
    loupe = view._loupe
    qtbot.mouseClick(loupe, Qt.MouseButton.LeftButton)
    qtbot.mouseDClick(loupe, Qt.MouseButton.LeftButton)
    assert len(places) == 2


def test_target_is_marked_without_any_scene(view: LiveView) -> None:
    _show(view, blank_frame(), make_scene())
    view.show_target((200.0, 120.0))
    assert near(picture(view), 200, 120, theme.TARGET, reach=16)
    view.show_target(None)
    assert not near(picture(view), 200, 120, theme.TARGET, reach=16)

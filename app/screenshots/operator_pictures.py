"""The operator window in the situations that the documents speak of."""

from __future__ import annotations

from app import theme
from app.operator_window import OperatorWindow
from app.screenshots.shots import SIZE, OperatorScene, Studio
from core.control.hand import AT_REST, Jog
from core.control.modes import Act, Mode
from core.errors import UserError
from core.types import Point

_TARGET: Point = (560.0, 318.0)
_FEED = Jog(advance=0.5)
_OUT_OF_FOCUS_PX = 9.0
_MOST_FRAMES = 1500


def advisory(studio: Studio) -> None:
    """By hand, with a destination."""
    with OperatorScene(studio, size=SIZE) as scene:
        scene.window.choose_target(*_TARGET)
        scene.stage.jog = Jog(bend=0.25, advance=0.7)
        scene.play(60)
        scene.stage.jog = _FEED
        scene.play(40)
        scene.stage.jog = AT_REST
        scene.show(scene.play(2), "operator_window")


def driving(studio: Studio) -> None:
    """The program drives."""
    with OperatorScene(studio) as scene:
        scene.window.choose_target(*_TARGET)
        scene.play(10)
        scene.aside(lambda: scene.stage.hand_over(_TARGET))
        scene.show(scene.play(70), "operator_driving")


def arrived(studio: Studio) -> None:
    """The program has driven to the destination, and given the robot back."""
    with OperatorScene(studio) as scene:
        scene.window.choose_target(*_TARGET)
        scene.play(10)
        scene.aside(lambda: scene.stage.hand_over(_TARGET))
        for _ in range(_MOST_FRAMES):
            scene.play(1)
            if scene.stage.pilot.view.mode is not Mode.AUTONOMOUS:
                break
        if scene.stage.pilot.view.mode is not Mode.ARMED:
            raise UserError("the twin did not get there: the destination was not reached")
        scene.show(scene.play(5), "operator_arrived")


def stopped(studio: Studio) -> None:
    """STOP was pressed while the program drove."""
    with OperatorScene(studio) as scene:
        scene.window.choose_target(*_TARGET)
        scene.aside(lambda: scene.stage.hand_over(_TARGET))
        scene.play(40)
        scene.stage.pilot.ask(Act.STOP)
        scene.stage.deadman = False
        scene.show(scene.play(3), "operator_stopped", lambda window: _turn_to(window, "Log"))


def no_answer(studio: Studio) -> None:
    """A picture of which nothing can be said: the reason stands where the letter would."""
    with OperatorScene(studio) as scene:
        scene.play(25)
        scene.stage.blur_px = _OUT_OF_FOCUS_PX
        scene.show(scene.play(12), "operator_no_answer")


def keys(studio: Studio) -> None:
    """The page of keys."""
    with OperatorScene(studio) as scene:
        scene.show(scene.play(5), "operator_keys", lambda window: window.panels.help.toggle())


def tour(studio: Studio) -> None:
    """The tour, at a stop in its middle."""

    def begin(window: OperatorWindow) -> None:
        window.show_tour()
        for _ in range(3):
            window.tour.forward()

    with OperatorScene(studio) as scene:
        scene.show(scene.play(30), "operator_tour", begin)


def small_and_light(studio: Studio) -> None:
    """The smallest common screen, in the light theme."""
    theme.apply_theme(studio.application, theme.Theme.LIGHT)
    try:
        with OperatorScene(studio) as scene:
            scene.window.choose_target(*_TARGET)
            scene.stage.jog = _FEED
            scene.show(scene.play(35), "operator_light")
    finally:
        theme.apply_theme(studio.application, theme.Theme.DARK)


def _turn_to(window: OperatorWindow, title: str) -> None:
    pages = window.panels.pages
    pages.setCurrentIndex(next(k for k in range(pages.count()) if pages.tabText(k) == title))

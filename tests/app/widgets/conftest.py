"""Fixtures of the widgets' tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import pytest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.widgets.alerts import AlertStrip
from core.control.alerts import ALERTS, Alert, AlertKey
from tests.app.hand_clock import Clock

Widget = TypeVar("Widget", bound=QWidget)
Own = Callable[..., Widget]


@pytest.fixture
def own(qtbot: QtBot) -> Callable[..., QWidget]:
    """Gives a widget to the test, in a size; with ``show=True`` on the screen."""

    def take(widget: Widget, *size: int, show: bool = False) -> Widget:
        qtbot.addWidget(widget)
        if size:
            widget.resize(*size)
        widget.setVisible(show)
        return widget

    return take


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def picture(own: Own) -> QWidget:
    """In the place of the live view."""
    return own(QWidget(), 775, 408, show=True)


@pytest.fixture
def strip(picture: QWidget, clock: Clock) -> AlertStrip:
    return AlertStrip(picture, clock)


def alert(key: AlertKey, detail: str = "", times: int = 1) -> Alert:
    return Alert(key, ALERTS[key], detail, times)


def words(key: AlertKey) -> str:
    """What is the matter and what to do, from the table, as two sentences."""
    text, what_to_do = ALERTS[key].text, ALERTS[key].what_to_do
    return f"{text}. {what_to_do[0].upper()}{what_to_do[1:]}."


def colours_in(widget: QWidget) -> set[str]:
    """All colours of every second pixel."""
    image = widget.grab().toImage()
    return {image.pixelColor(x, y).name().upper() for x in range(0, image.width(), 2) for y in range(0, image.height(), 2)}

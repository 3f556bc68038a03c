"""A hand at the window that teaches a bench: real clicks and keys, counted, on pictures that stand for the camera."""

from __future__ import annotations

import time
from pathlib import Path

from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QWidget
from pytestqt.qtbot import QtBot

from app.teaching.model import TeachingModel
from app.teaching.window import TeachingDriver, TeachingWindow
from app.ui.texts import OperatorStep
from core.learning.teaching import Segment
from core.types import Frame, Image

LONG_MS = 120_000


class PictureFeed:
    """The newest frame of a camera that shows the given pictures in turn; each call is a new frame."""

    def __init__(self, pictures: list[Image]) -> None:
        self.pictures = pictures
        self.is_live = True
        self._index = 0

    def __call__(self) -> Frame | None:
        self._index += 1
        return Frame(self._index, time.monotonic(), self.pictures[self._index % len(self.pictures)]) if self.is_live else None


class BenchHand:
    """A window on a feed, and a hand that counts its input events: a click, a drag, a key."""

    def __init__(self, qtbot: QtBot, folder: Path, feed: PictureFeed, segment: Segment) -> None:
        self.events = 0
        self.refusal = ""
        self.used: list[str] = []
        self.in_use = ""
        self._qtbot, self.feed = qtbot, feed
        self.model = TeachingModel(folder, "toy", feed, lambda: segment)
        self.model._watch.setInterval(10)
        self.asked: list[OperatorStep] = []
        driver = TeachingDriver(lambda _jog: None, lambda: None, self.asked.append, lambda: False)
        self.window = TeachingWindow(self.model, feed, driver, self._use, lambda name: name == self.in_use)
        qtbot.addWidget(self.window)

    def _use(self, name: str) -> str:
        if not self.refusal:
            self.used.append(name)
            self.in_use = name
        return self.refusal

    def open(self) -> None:
        """Open the window, and wait until what was taken before is read."""
        self.window.open()
        self.wait()

    def wait(self) -> None:
        """Until no job runs."""
        self._qtbot.waitUntil(lambda: not self.model.is_busy and not self.model._then, timeout=LONG_MS)

    def click(self, button: QAbstractButton) -> None:
        """Click a button that can be clicked, and wait for what it does."""
        assert button.isEnabled(), f"{button.text()}: {self.window.message}"
        self.events += 1
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)
        self.wait()

    def drag(self, widget: QWidget, points: list[tuple[float, float]]) -> None:
        """Drag with the left button through places of a widget."""
        self.events += 1
        places = [QPoint(round(x), round(y)) for x, y in points]
        QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=places[0])
        for place in places[1:]:
            QTest.mouseMove(widget, place)
        QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=places[-1])
        self.wait()

    def show(self, picture: Image) -> None:
        """The camera shows this picture until it has been looked at."""
        self.feed.pictures = [picture]
        with self._qtbot.waitSignal(self.model.looked, timeout=LONG_MS):
            pass
        with self._qtbot.waitSignal(self.model.looked, timeout=LONG_MS):  # the one before may have been of the last picture
            pass

    def end(self) -> None:
        self.window.end()
        assert self.model.wait()

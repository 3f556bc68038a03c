"""Alerts over the upper edge of the live picture, most urgent first, which disappear after some time; and their sounds."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QObject, QPointF, QProcess, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QAccessible, QAccessibleAnnouncementEvent, QColor, QFont, QMouseEvent, QPainter, QPainterPath
from PySide6.QtWidgets import QApplication, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import sentence
from app.widgets.basics import OnResize
from app.widgets.painting import FieldLook, PaintedWidget, Sign, draw_text, paint_sign, set_colours, text_width
from core.config.models import RESOURCES
from core.control.alerts import Alert, AlertKey, Priority
from core.control.drive_view import DriveView
from core.control.faults import Cause

FULL, COMPACT = 44, 26
"""Heights of a row with two lines and with one, px."""
_PLATE, _BETWEEN, _CROSS = 44, 12, 9

LOOK = {
    Priority.HINT: FieldLook("SKY", Sign.INFO),
    Priority.WARNING: FieldLook("ORANGE", Sign.WARNING),
    Priority.HOLD: FieldLook("YELLOW", Sign.PAUSE),
    Priority.DISARM: FieldLook("VERMILLION", Sign.BARRED),
    Priority.STOP: FieldLook("VERMILLION", Sign.STOP, filled=True),
}


@dataclass(frozen=True, slots=True)
class ShownAlert:
    """An alert with its count and when it was last active."""

    alert: Alert
    times: int
    last_s: float

    @property
    def text(self) -> str:
        detail = f" ({tr_text(self.alert.detail)})" if self.alert.detail else ""
        times = f" \N{MULTIPLICATION SIGN}{self.times}" if self.times > 1 else ""
        return f"{sentence(f'{tr(self.alert.spec.text)}{detail}{times}')} {sentence(self.alert.spec.what_to_do)}"

    def lines(self, *, full: bool) -> tuple[tuple[tuple[str, QFont], ...], ...]:
        """The texts of each line with their fonts; the first one is the alert's name."""
        name, what_to_do = tr(self.alert.spec.text), sentence(self.alert.spec.what_to_do)
        if not full:
            return (((name, theme.bold(15)), (what_to_do, theme.font(13))),)
        return ((name, theme.bold(16)), (tr_text(self.alert.detail), theme.font(13))), ((what_to_do, theme.font(14)),)

    def needed_width(self, *, full: bool) -> int:
        """Of a row that shows all of it, with room for its counts."""
        words = max(sum(text_width(font, text) + _BETWEEN for text, font in line) for line in self.lines(full=full))
        notes = text_width(theme.semi_bold(14), "\N{MULTIPLICATION SIGN}99")
        return _PLATE + _BETWEEN + words + notes + 14 + _CROSS + _BETWEEN + 4


class AlertRow(PaintedWidget):
    """One alert; two lines where it is high enough. ``dismissed`` carries its key."""

    dismissed = Signal(object)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent=parent)
        self.entry: ShownAlert | None = None
        self._hidden = 0
        self._is_pressed = False
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def show_entry(self, entry: ShownAlert | None, hidden: int) -> None:
        """`hidden` is how many more there are without a row."""
        if (entry, hidden) != (self.entry, self._hidden):
            self.entry, self._hidden = entry, hidden
            if entry is not None:
                self.setAccessibleName(entry.text)
                self.setToolTip(f"{entry.text}\n{tr('Click to dismiss')}")
            self.update()
        self.setVisible(entry is not None)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Taken here, so that no target is set behind it."""
        self._is_pressed = True
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """The second half of a double click does not dismiss the alert that has taken the place of the first."""
        event.accept()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        was_pressed, self._is_pressed = self._is_pressed, False
        if was_pressed and self.entry is not None and self.rect().contains(event.position().toPoint()):
            self.dismissed.emit(self.entry.alert.key)

    def paint(self, painter: QPainter) -> None:
        if self.entry is None:
            return
        look = LOOK[self.entry.alert.spec.priority]
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        outline = QPainterPath()
        outline.addRoundedRect(frame, 7, 7)
        painter.fillPath(outline, QColor(look.colour if look.filled else theme.PANEL))
        plate = QRectF(frame.left(), frame.top(), _PLATE, frame.height())
        painter.save()
        painter.setClipPath(outline)
        painter.fillRect(plate, QColor(look.colour))
        painter.restore()
        set_colours(painter, None, look.colour, 1.5)
        painter.drawPath(outline)
        is_full = self.height() >= FULL
        sign = QRectF(0, 0, 24, 24) if is_full else QRectF(0, 0, 18, 18)
        sign.moveCenter(plate.center())
        paint_sign(painter, sign, look.sign, QColor(theme.INK))
        ink, dim = (theme.INK, theme.INK) if look.filled else (theme.TEXT, theme.TEXT_DIM)
        room = frame.adjusted(_PLATE + _BETWEEN, 0, -_BETWEEN, 0)
        room.setRight(self._paint_right(painter, room, dim))
        lines = self.entry.lines(full=is_full)
        height = (room.height() - 4) / len(lines)
        for k, parts in enumerate(lines):
            line = QRectF(room.left(), room.top() + 2 + k * height, room.width(), height)
            _paint_line(painter, line, parts, (ink, dim) if k == 0 else (dim,))

    def _paint_right(self, painter: QPainter, room: QRectF, ink: str) -> float:
        """A cross, how often it came and how many more there are; returns where the room for words ends."""
        arm = _CROSS / 2
        middle = QPointF(room.right() - arm, room.center().y())
        set_colours(painter, None, ink, 1.6)
        for corner in (QPointF(arm, arm), QPointF(arm, -arm)):
            painter.drawLine(middle - corner, middle + corner)
        notes = [f"\N{MULTIPLICATION SIGN}{self.entry.times}"] if self.entry is not None and self.entry.times > 1 else []
        if self._hidden:
            notes.append(tr("+{count} more", count=self._hidden))
        text, font = "   ".join(notes), theme.semi_bold(14)
        width = text_width(font, text)
        left = room.right() - _CROSS - 14 - width
        draw_text(painter, QRectF(left, room.top(), width + 2, room.height()), text, font, ink)
        return left - _BETWEEN


def _paint_line(painter: QPainter, room: QRectF, parts: Sequence[tuple[str, QFont]], inks: Sequence[str]) -> None:
    """Texts after each other; the last one is cut where there is no more room."""
    room = QRectF(room)
    for (text, font), ink in zip(parts, inks, strict=False):
        if room.width() < 24 or not text:
            break
        draw_text(painter, room, text, font, ink, smallest_px=font.pixelSize() - 2, elided=True)
        shown = theme.elide(painter.font(), text, int(room.width()))
        room.setLeft(room.left() + text_width(painter.font(), shown) + _BETWEEN)


MOST_ROWS = 3
MOST_SHARE = 0.26
"""Of the picture's height."""
BRIEF_S = {Priority.HINT: 4.0, Priority.WARNING: 8.0}
LINGER_S = 15.0
"""How long the others stay after their fault is over, unless it was acknowledged."""
_GAP = 3
_MARGIN = 12
_WIDTHS = (420, 760)
_CHECK_EVERY_MS = 200


class AlertStrip(QWidget):
    """At most three alerts; the others wait for room. A click dismisses one. It follows the size of its parent."""

    def __init__(self, parent: QWidget, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(parent)
        self._parent = parent
        self._clock = clock
        self._entries: dict[AlertKey, ShownAlert] = {}
        self._latched: Cause | None = None
        self._rows = [AlertRow(self) for _ in range(MOST_ROWS)]
        for row in self._rows:
            row.dismissed.connect(self._dismiss)
        self._timer = QTimer(self, interval=_CHECK_EVERY_MS)
        self._timer.timeout.connect(self._expire)
        OnResize(parent, self, self._on_resize)
        self.hide()

    @property
    def texts(self) -> list[str]:
        """What is shown, from above."""
        return [row.entry.text for row in self._rows if row.entry is not None and row.isVisibleTo(self)]

    def show_alerts(self, alerts: Sequence[Alert]) -> None:
        """Add `alerts`; one that is still shown is counted instead."""
        if not alerts:
            return
        now = self._clock()
        for alert in alerts:
            before = self._entries.pop(alert.key, None)
            times = max(1, alert.times + (before.times if before is not None else 0))
            self._entries[alert.key] = ShownAlert(alert, times, now)  # the newest one is the last
            if before is None:
                self._announce(self._entries[alert.key])
        self._show()

    def show_view(self, view: DriveView | None) -> None:
        """Keep what is still active, drop what the operator acknowledged."""
        latched = view.latched.cause if view is not None and view.latched is not None else None
        before, self._latched = self._latched, latched
        if not self._entries:
            return
        now = self._clock()
        acknowledged = before is not None and latched is None
        active = {fault.cause for fault in view.active} if view is not None else set()
        for key, entry in list(self._entries.items()):
            if entry.alert.spec.priority in BRIEF_S:
                continue
            if acknowledged and (key == before or key not in active):
                del self._entries[key]
            elif key == latched or key in active:
                self._entries[key] = replace(entry, last_s=now)
        self._expire()

    def clear(self) -> None:
        self._entries.clear()
        self._show()

    def _expire(self) -> None:
        now = self._clock()
        over = [k for k, entry in self._entries.items() if now - entry.last_s >= BRIEF_S.get(entry.alert.spec.priority, LINGER_S)]
        for key in over:
            del self._entries[key]
        wanted = [entry.alert.key for entry in self._in_order()[: len(self._heights())]]
        if over or wanted != [row.entry.alert.key for row in self._rows if row.entry is not None]:
            self._show()

    def _in_order(self) -> list[ShownAlert]:
        newest_first = reversed(self._entries.values())
        return sorted(newest_first, key=lambda entry: -entry.alert.spec.priority)

    def _heights(self) -> list[int]:
        """Of the rows that have room, from above: the most urgent ones with two lines, the others with one."""
        room = MOST_SHARE * self._parent.height()
        count = min(MOST_ROWS, len(self._entries))
        while count > 1 and count * (COMPACT + _GAP) - _GAP > room:
            count -= 1
        heights = [COMPACT] * count
        for k in range(count):
            if sum(heights) + (count - 1) * _GAP + FULL - COMPACT <= room:
                heights[k] = FULL
        return heights

    def _show(self) -> None:
        entries, heights = self._in_order(), self._heights()
        hidden = len(entries) - len(heights)
        least, most = _WIDTHS
        needed = (entry.needed_width(full=height == FULL) for entry, height in zip(entries, heights, strict=False))
        width, top = min(max(least, *needed, 0), most, self._parent.width() - 2 * _MARGIN), 0
        for k, row in enumerate(self._rows):
            if k >= len(heights):
                row.show_entry(None, 0)
                continue
            row.setGeometry(0, top, width, heights[k])
            row.show_entry(entries[k], hidden if k == len(heights) - 1 else 0)
            top += heights[k] + _GAP
        self.setAccessibleName(tr("Alerts: ") + " ".join(self.texts) if heights else tr("No alerts"))
        if not heights:
            self._timer.stop()
            self.hide()
            return
        # on the left: the loupe prefers the right
        self.setGeometry(_MARGIN, _MARGIN, width, top - _GAP)
        if not self._timer.isActive():
            self._timer.start()
        if self.isHidden():
            self.show()
            self.raise_()

    def _dismiss(self, key: AlertKey) -> None:
        self._entries.pop(key, None)
        self._show()

    def _announce(self, entry: ShownAlert) -> None:
        """Tell screen readers; what interrupts a motion interrupts them, too."""
        event = QAccessibleAnnouncementEvent(self, entry.text)
        if entry.alert.spec.priority >= Priority.HOLD:
            event.setPoliteness(QAccessible.AnnouncementPoliteness.Assertive)
        QAccessible.updateAccessibility(event)

    def _on_resize(self) -> None:
        if self._entries:
            self._show()


SOUNDS = ("hold", "disarm", "stop")
"""Names as in ``core.control.alerts``, most urgent last."""
_PLAYERS = (("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",))
_LONGEST_MS = 3000
_END_WITHIN_MS = 500

_log = logging.getLogger(__name__)


class AlertSounds(QObject):
    """Plays one sound of `folder` at a time, by a player that the system has, and never waits for it; without a player it beeps.

    A more urgent sound replaces the one being played, others are dropped. A player that fails (it is installed, but there is no
    sound server) is given up with one line in the log, and the sound goes to the next one.
    """

    def __init__(self, parent: QObject | None = None, folder: Path = RESOURCES / "sounds") -> None:
        super().__init__(parent)
        self._folder = folder
        self._players = [(path, *rest) for name, *rest in _PLAYERS if (path := shutil.which(name)) is not None]
        self.playing: str | None = None  # the sound that is heard now
        self._next: str | None = None
        self._cut_short = False
        self._is_logged = False
        self._process = QProcess(self)
        self._process.setStandardOutputFile(QProcess.nullDevice())
        self._process.setStandardInputFile(QProcess.nullDevice())
        self._process.finished.connect(self._on_finished)
        self._process.errorOccurred.connect(self._on_error)
        self._guard = QTimer(self, singleShot=True, interval=_LONGEST_MS)
        self._guard.timeout.connect(self._process.kill)  # a player that hangs is a player that fails
        application = QCoreApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self.close)
        if parent is not None:
            parent.destroyed.connect(self.close)  # before its children are destroyed: Qt warns of a process that still runs then

    def play(self, name: str) -> None:
        """Play the sound `name` (one of ``SOUNDS``), unless an equally or more urgent one is being heard. Returns at once."""
        if name not in SOUNDS or not (self._folder / f"{name}.wav").is_file():
            self._log_once("there is no sound %r in %s; put resources/sounds back", name, self._folder)
            QApplication.beep()
        elif self.playing is None:
            self._start(name)
        elif SOUNDS.index(name) > SOUNDS.index(self._next or self.playing):
            self._next = name
            self._cut()

    def close(self) -> None:
        """Stop the sound; waits for its process half a second at most."""
        self._next = None
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._cut()
            self._process.waitForFinished(_END_WITHIN_MS)

    def _start(self, name: str) -> None:
        if not self._players:
            self._log_once("no player of sounds works (looked for pw-play, paplay, aplay, afplay): alerts only beep")
            QApplication.beep()
            return
        program, *options = self._players[0]
        self.playing = name
        self._cut_short = False
        self._guard.start()
        self._process.start(program, [*options, str(self._folder / f"{name}.wav")])

    def _cut(self) -> None:
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._cut_short = True
            self._process.kill()

    def _on_finished(self, code: int, status: QProcess.ExitStatus) -> None:
        failed = not self._cut_short and (code != 0 or status != QProcess.ExitStatus.NormalExit)
        error = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
        self._go_on("gave up" if failed else None, " ".join(error.split())[:200] or f"exit code {code}")

    def _on_error(self, error: QProcess.ProcessError) -> None:
        # a process that never started does not finish either
        if error == QProcess.ProcessError.FailedToStart:
            self._go_on("did not start", self._process.errorString())

    def _go_on(self, failure: str | None, why: str) -> None:
        """The process has ended: play what waits, or the same once more by another player when this one failed."""
        self._guard.stop()
        name, self.playing = self.playing, None
        following, self._next = self._next, None
        if failure is not None:
            player = self._players.pop(0)
            _log.warning("the player %s %s: %s", player[0], failure, why)
            following = following or name
        if following is not None:
            self._start(following)

    def _log_once(self, message: str, *values: object) -> None:
        if not self._is_logged:
            self._is_logged = True
            _log.warning(message, *values)

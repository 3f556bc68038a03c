"""Alerts over the upper edge of the live picture, most urgent first; they go away by themselves.

One alert over the live picture: how urgent it is, what is the matter and what to do.

Alert sounds by whatever player the system has; without one, its beep.
"""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QPointF, QProcess, QRectF, Qt, QTimer, Signal, Slot
from PySide6.QtGui import (
    QAccessible,
    QAccessibleAnnouncementEvent,
    QColor,
    QFont,
    QFontMetrics,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
)
from PySide6.QtWidgets import QApplication, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import sentence
from app.widgets.basics import Sign, paint_sign
from core.config.models import RESOURCES
from core.control.alerts import Alert, AlertKey, Priority
from core.control.faults import Cause
from core.control.pilot import DriveView

FULL, COMPACT = 44, 26
"""Heights of a row with two lines and with one, px."""
_PLATE, _ROW_GAP, _CROSS = 44, 12, 9


@dataclass(frozen=True, slots=True)
class PriorityLook:
    """How urgent, by colour and sign; ``filled`` colours all of the row."""

    role: str
    sign: Sign
    filled: bool = False

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return theme.of(self.role)


LOOK = {
    Priority.HINT: PriorityLook("SKY", Sign.INFO),
    Priority.WARNING: PriorityLook("ORANGE", Sign.WARNING),
    Priority.HOLD: PriorityLook("YELLOW", Sign.PAUSE),
    Priority.DISARM: PriorityLook("VERMILLION", Sign.BARRED),
    Priority.STOP: PriorityLook("VERMILLION", Sign.STOP, filled=True),
}


@dataclass(frozen=True, slots=True)
class ShownAlert:
    """An alert with how often it came, its turn and when it last mattered."""

    alert: Alert
    times: int
    turn: int
    last_s: float

    @property
    def text(self) -> str:
        detail = f" ({tr_text(self.alert.detail)})" if self.alert.detail else ""
        times = f" \N{MULTIPLICATION SIGN}{self.times}" if self.times > 1 else ""
        return f"{sentence(f'{tr(self.alert.spec.text)}{detail}{times}')} {sentence(self.alert.spec.what_to_do)}"


class AlertRow(QWidget):
    """One alert; two lines where it is high enough. ``dismissed`` carries its key."""

    dismissed = Signal(object)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
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
        """Taken here, so that no destination is set behind it."""
        self._is_pressed = True
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Its second half is not for the alert that has taken the place of the dismissed one: nobody has read that yet."""
        event.accept()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        was_pressed, self._is_pressed = self._is_pressed, False
        if was_pressed and self.entry is not None and self.rect().contains(event.position().toPoint()):
            self.dismissed.emit(self.entry.alert.key)

    def needed_width(self, entry: ShownAlert, *, full: bool) -> int:
        """Of a row that shows all of `entry`, with room for its counts."""
        words = max(sum(QFontMetrics(f).horizontalAdvance(t) + _ROW_GAP for t, f in line) for line in _lines(entry, full=full))
        notes = QFontMetrics(theme.semi_bold(14)).horizontalAdvance("\N{MULTIPLICATION SIGN}99")
        return _PLATE + _ROW_GAP + words + notes + 14 + _CROSS + _ROW_GAP + 4

    # ---- the look

    def paintEvent(self, event: QPaintEvent) -> None:
        entry = self.entry
        if entry is None:
            return
        look = LOOK[entry.alert.spec.priority]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        colour = QColor(look.colour)
        outline = QPainterPath()
        outline.addRoundedRect(frame, 7, 7)
        painter.fillPath(outline, colour if look.filled else QColor(theme.PANEL))
        plate = QRectF(frame.left(), frame.top(), _PLATE, frame.height())
        painter.save()
        painter.setClipPath(outline)
        painter.fillRect(plate, colour)
        painter.restore()
        painter.setPen(QPen(colour, 1.5))
        painter.drawPath(outline)
        ink = QColor(theme.INK)
        side = 24.0 if self.height() >= FULL else 18.0
        middle = plate.center()
        paint_sign(painter, QRectF(middle.x() - side / 2, middle.y() - side / 2, side, side), look.sign, ink)
        room = frame.adjusted(_PLATE + _ROW_GAP, 0, -_ROW_GAP, 0)
        room.setRight(self._paint_right(painter, room, QColor(ink if look.filled else theme.TEXT_DIM)))
        self._paint_words(painter, room, entry, *((ink, ink) if look.filled else (QColor(theme.TEXT), QColor(theme.TEXT_DIM))))
        painter.end()

    def _paint_right(self, painter: QPainter, room: QRectF, ink: QColor) -> float:
        """A cross and the counts; returns where the room for words ends."""
        arm = _CROSS / 2
        middle = QPointF(room.right() - arm, room.center().y())
        painter.setPen(QPen(ink, 1.6))
        for corner in (QPointF(arm, arm), QPointF(arm, -arm)):
            painter.drawLine(middle - corner, middle + corner)
        text, note_font = self._note(), theme.semi_bold(14)
        painter.setFont(note_font)
        width = QFontMetrics(note_font).horizontalAdvance(text)
        left = room.right() - _CROSS - 14 - width
        painter.drawText(QRectF(left, room.top(), width + 2, room.height()), Qt.AlignmentFlag.AlignVCenter, text)
        return left - _ROW_GAP

    def _note(self) -> str:
        """How often it came, and how many more there are."""
        notes = []
        if self.entry is not None and self.entry.times > 1:
            notes.append(f"\N{MULTIPLICATION SIGN}{self.entry.times}")
        if self._hidden:
            notes.append(tr("+{count} more", count=self._hidden))
        return "   ".join(notes)

    def _paint_words(self, painter: QPainter, room: QRectF, entry: ShownAlert, ink: QColor, dim: QColor) -> None:
        lines = _lines(entry, full=self.height() >= FULL)
        height = (room.height() - 4) / len(lines)
        for k, parts in enumerate(lines):
            line = QRectF(room.left(), room.top() + 2 + k * height, room.width(), height)
            inks = (ink, dim) if k == 0 else (dim,)
            self._paint_line(
                painter, line, *((text, text_font, tint) for (text, text_font), tint in zip(parts, inks, strict=False))
            )

    @staticmethod
    def _paint_line(painter: QPainter, room: QRectF, *parts: tuple[str, QFont, QColor]) -> None:
        """Texts after each other, each with its font and ink; the last one is cut where there is no more room."""
        left = room.left()
        for text, text_font, ink in parts:
            width = room.right() - left
            if width < 24 or not text:
                break
            smaller = theme.fitted(text_font, text, int(width), text_font.pixelSize() - 2)
            painter.setFont(smaller)
            painter.setPen(ink)
            shown = theme.elide(smaller, text, int(width))
            painter.drawText(QRectF(left, room.top(), width, room.height()), Qt.AlignmentFlag.AlignVCenter, shown)
            left += QFontMetrics(smaller).horizontalAdvance(shown) + _ROW_GAP


def _lines(entry: ShownAlert, *, full: bool) -> tuple[tuple[tuple[str, QFont], ...], ...]:
    """The texts of each line with their fonts; the first one is the alert's name."""
    spec, what_to_do = entry.alert.spec, sentence(entry.alert.spec.what_to_do)
    if not full:
        return (((tr(spec.text), theme.bold(15)), (what_to_do, theme.font(13))),)
    return ((tr(spec.text), theme.bold(16)), (tr_text(entry.alert.detail), theme.font(13))), ((what_to_do, theme.font(14)),)


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
        self._turn = 0
        self._rows = [AlertRow(self) for _ in range(MOST_ROWS)]
        for row in self._rows:
            row.dismissed.connect(self._dismiss)
        self._timer = QTimer(self)
        self._timer.setInterval(_CHECK_EVERY_MS)
        self._timer.timeout.connect(self._expire)
        parent.installEventFilter(self)
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
            times = 1 + alert.repeats + (before.times if before is not None else 0)
            self._turn += 1
            self._entries[alert.key] = ShownAlert(alert, times, self._turn, now)
            if before is None:
                self._announce(self._entries[alert.key])
        self._show()

    def show_view(self, view: DriveView | None) -> None:
        """Keep what is still true, drop what the operator acknowledged."""
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
        """Show nothing: what comes next is another rig."""
        self._entries.clear()
        self._show()

    # ---- what is shown

    @Slot()
    def _expire(self) -> None:
        now = self._clock()
        over = [
            key for key, entry in self._entries.items() if now - entry.last_s >= BRIEF_S.get(entry.alert.spec.priority, LINGER_S)
        ]
        for key in over:
            del self._entries[key]
        if over or self._shown_keys() != [row.entry.alert.key for row in self._rows if row.entry is not None]:
            self._show()

    def _shown_keys(self) -> list[AlertKey]:
        return [entry.alert.key for entry in self._in_order()[: len(self._heights())]]

    def _in_order(self) -> list[ShownAlert]:
        return sorted(self._entries.values(), key=lambda entry: (-entry.alert.spec.priority, -entry.turn))

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

    def _width(self, entries: Sequence[ShownAlert], heights: Sequence[int]) -> int:
        """As wide as the longest row needs, if there is room."""
        least, most = _WIDTHS
        shown = zip(entries, heights, strict=False)
        needed = max((self._rows[0].needed_width(entry, full=height == FULL) for entry, height in shown), default=0)
        return min(max(least, needed), most, self._parent.width() - 2 * _MARGIN)

    def _show(self) -> None:
        entries, heights = self._in_order(), self._heights()
        hidden = len(entries) - len(heights)
        width = self._width(entries, heights)
        top = 0
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

    @Slot(object)
    def _dismiss(self, key: AlertKey) -> None:
        self._entries.pop(key, None)
        self._show()

    def _announce(self, entry: ShownAlert) -> None:
        """Tell screen readers; what interrupts a motion interrupts them, too."""
        event = QAccessibleAnnouncementEvent(self, entry.text)
        if entry.alert.spec.priority >= Priority.HOLD:
            event.setPoliteness(QAccessible.AnnouncementPoliteness.Assertive)
        QAccessible.updateAccessibility(event)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self._entries:
            self._show()
        return False


SOUNDS = ("hold", "disarm", "stop")
"""Names as in ``core.control.alerts``, most urgent last."""
_PLAYERS = (("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",))
_LONGEST_MS = 3000
_END_WITHIN_MS = 500

_log = logging.getLogger(__name__)


class AlertSounds(QObject):
    """Plays one sound at a time and never waits for it.

    While a sound is heard, only a more urgent one is played, instead of it. A player that fails (it is installed, but there is no
    sound server) is given up with one line in the log, and the sound goes to the next one.

    Parameters
    ----------
    parent : owner.
    folder : where ``<name>.wav`` are.
    """

    def __init__(self, parent: QObject | None = None, folder: Path = RESOURCES / "sounds") -> None:
        super().__init__(parent)
        self._folder = folder
        self._players = [(path, *rest) for name, *rest in _PLAYERS if (path := shutil.which(name)) is not None]
        self._muted = False
        self._playing: str | None = None
        self._next: str | None = None
        self._cut_short = False
        self._is_logged = False
        self._process = QProcess(self)
        self._process.setStandardOutputFile(QProcess.nullDevice())
        self._process.setStandardInputFile(QProcess.nullDevice())
        self._process.finished.connect(self._on_finished)
        self._process.errorOccurred.connect(self._on_error)
        self._guard = QTimer(self)
        self._guard.setSingleShot(True)
        self._guard.setInterval(_LONGEST_MS)
        self._guard.timeout.connect(self._process.kill)  # a player that hangs is a player that fails
        application = QCoreApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self.close)
        if parent is not None:
            parent.destroyed.connect(self.close)  # comes before its children go, and Qt warns of a process that goes while it runs

    @property
    def muted(self) -> bool:
        """Nothing is heard."""
        return self._muted

    @muted.setter
    def muted(self, muted: bool) -> None:
        self._muted = muted
        if muted:
            self._next = None
            self._cut()

    @property
    def playing(self) -> str | None:
        """The sound that is heard now."""
        return self._playing

    def play(self, name: str) -> None:
        """Play the sound `name` (one of ``SOUNDS``), unless an equally or more urgent one is being heard. Returns at once."""
        if self._muted:
            return
        if name not in SOUNDS or not (self._folder / f"{name}.wav").is_file():
            self._log_once("there is no sound %r in %s; put resources/sounds back", name, self._folder)
            QApplication.beep()
        elif self._playing is None:
            self._start(name)
        elif SOUNDS.index(name) > SOUNDS.index(self._next or self._playing):
            self._next = name
            self._cut()

    @Slot()
    def close(self) -> None:
        """End what is being heard; waits for it half a second at most."""
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
        self._playing = name
        self._cut_short = False
        self._guard.start()
        self._process.start(program, [*options, str(self._folder / f"{name}.wav")])

    def _cut(self) -> None:
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._cut_short = True
            self._process.kill()

    @Slot(int, QProcess.ExitStatus)
    def _on_finished(self, code: int, status: QProcess.ExitStatus) -> None:
        failed = not self._cut_short and (code != 0 or status != QProcess.ExitStatus.NormalExit)
        error = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
        self._go_on("gave up" if failed else None, " ".join(error.split())[:200] or f"exit code {code}")

    @Slot(QProcess.ProcessError)
    def _on_error(self, error: QProcess.ProcessError) -> None:
        # a process that never started does not finish either
        if error == QProcess.ProcessError.FailedToStart:
            self._go_on("did not start", self._process.errorString())

    def _go_on(self, failure: str | None, why: str) -> None:
        """The process has ended: play what waits, or the same once more by another player when this one failed."""
        self._guard.stop()
        name, self._playing = self._playing, None
        following, self._next = self._next, None
        if failure is not None:
            player = self._players.pop(0)
            _log.warning("the player %s %s: %s", player[0], failure, why)
            following = following or name
        if following is not None and not self._muted:
            self._start(following)

    def _log_once(self, message: str, *values: object) -> None:
        if not self._is_logged:
            self._is_logged = True
            _log.warning(message, *values)

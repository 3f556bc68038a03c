"""Alerts over the upper edge of the live picture, most urgent first; they go away by themselves."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from PySide6.QtCore import QEvent, QObject, QTimer, Slot
from PySide6.QtGui import QAccessible, QAccessibleAnnouncementEvent
from PySide6.QtWidgets import QWidget

from app.language import tr
from app.widgets.alert_row import COMPACT, FULL, AlertRow, ShownAlert
from core.control.alerts import Alert, AlertKey, Priority
from core.control.drive_view import DriveView
from core.control.faults import Cause

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

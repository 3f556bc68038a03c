"""Two columns with a handle between them; their shares of the width stay when the window grows."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSplitter, QWidget

from app import theme
from app.language import tr

_LEAST, _MOST = 0.2, 0.9


class Columns(QSplitter):
    """`share` is the left one's of the width; neither can be closed."""

    def __init__(self, left: QWidget, right: QWidget, share: float) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._share = share
        self.addWidget(left)
        self.addWidget(right)
        self.setChildrenCollapsible(False)
        self.setHandleWidth(theme.GAP)
        handle = self.handle(1)
        handle.setToolTip(tr("Drag to give one side more room"))
        handle.setAccessibleName(tr("Border between the columns"))
        self.splitterMoved.connect(self._on_moved)

    @property
    def share(self) -> float:
        """The left column's share of the width."""
        return self._share

    def set_share(self, share: float) -> None:
        """Another share, as far as the columns allow it."""
        self._share = max(_LEAST, min(_MOST, share))
        self._place()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place()

    def _place(self) -> None:
        room = self.width() - self.handleWidth()
        if room > 0:
            left = round(room * self._share)
            self.setSizes([left, room - left])

    def _on_moved(self, _position: int, _handle: int) -> None:
        left, right = self.sizes()
        self._share = left / max(1, left + right)

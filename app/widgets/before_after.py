"""The same picture before and after: what a network found of it then, and finds now."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPixmap, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from app import palette, theme
from app.language import tr


class _Picture(QLabel):
    """A file's picture, as large as fits."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self.setMinimumSize(200, 130)
        theme.set_sheet(self, "color: @TEXT_FAINT;")
        self._pixmap = QPixmap()

    def show_file(self, path: Path | None) -> None:
        self._pixmap = QPixmap(str(path)) if path is not None and path.is_file() else QPixmap()
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit()

    def sizeHint(self) -> QSize:
        return QSize(320, 220)

    def _fit(self) -> None:
        if self._pixmap.isNull():
            self.setText(tr("shown when the training has begun"))
            return
        smooth = Qt.TransformationMode.SmoothTransformation
        self.setPixmap(self._pixmap.scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio, smooth))


class BeforeAfter(QWidget):
    """Two pictures side by side, of one frame at a time."""

    def __init__(self) -> None:
        super().__init__()
        self._before: tuple[str, ...] = ()
        self._after: tuple[str, ...] = ()
        self._place = 0
        self._left, self._right = _Picture(tr("Before")), _Picture(tr("After"))
        self._title = QLabel()
        self._title.setObjectName("card_note")
        self._next = QPushButton(tr("&Next picture"))
        self._next.setAutoDefault(False)
        self._next.clicked.connect(self._on_next)
        head = QHBoxLayout()
        head.addWidget(self._title, 1)
        head.addWidget(self._next)
        pictures = QHBoxLayout()
        for word, picture in ((tr("Before"), self._left), (tr("After"), self._right)):
            column = QVBoxLayout()
            label = QLabel(word)
            label.setObjectName("card_title")
            column.addWidget(label)
            column.addWidget(picture, 1)
            pictures.addLayout(column, 1)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addLayout(pictures, 1)
        whole.addLayout(head)
        self._show()

    @property
    def title(self) -> str:
        return self._title.text()

    def show_pictures(self, before: tuple[str, ...], after: tuple[str, ...]) -> None:
        """Paths of the same frames then and now; they are read again, for they may have been written anew."""
        self._before, self._after = before, after
        self._place = min(self._place, max(0, len(before) - 1))
        self._show()

    def _on_next(self) -> None:
        self._place = (self._place + 1) % max(1, len(self._before))
        self._show()

    def _show(self) -> None:
        count = len(self._before)
        self._next.setEnabled(count > 1)
        for picture, paths in ((self._left, self._before), (self._right, self._after)):
            picture.show_file(Path(paths[self._place]) if self._place < len(paths) else None)
        colours = palette.ON_PICTURE
        vessel, robot = (
            f'<span style="color:{c}">\N{BLACK SQUARE}</span>&nbsp;{n}'
            for c, n in ((colours.VESSEL, tr("vessel")), (colours.ROBOT, tr("robot")))
        )
        found = tr("colour: found ({vessel}, {robot})", vessel=vessel, robot=robot)
        which = (
            tr("Held-out picture {place} of {count}; {found}, line: drawn by hand", place=self._place + 1, count=count, found=found)
            if count
            else tr("Held-out pictures")
        )
        self._title.setText(which)

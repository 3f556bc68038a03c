"""All keys of the annotator on one page, over the window."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app import palette, theme

KEY_COLUMNS: tuple[tuple[tuple[str, tuple[tuple[str, str], ...]], ...], ...] = (
    (
        (
            "Draw",
            (
                ("1   2", "robot line, vessel line; again: more points"),
                ("Click", "set a point; drag moves one"),
                ("Enter, double click", "end the line, take the state, go on"),
                ("Right click, Del", "take a point out; Shift+Del: the whole line"),
                ("Tab", "select the next point"),
                ("Arrows", "move it by 1 px; Ctrl 0.1, Shift 10"),
                ("Arrows, Insert", "no point selected: move the cross, set a point"),
                ("Esc", "let go"),
                ("Ctrl+Z   Ctrl+Shift+Z", "undo, redo, without limit"),
            ),
        ),
    ),
    (
        (
            "Answer",
            (
                ("A   B   C   D", "the pose state"),
                ("X", "can't tell"),
                ("F2", "note"),
                ("G", "take the algorithm's lines or masks"),
            ),
        ),
        (
            "Masks",
            (
                ("3   4", "robot mask, vessel mask"),
                ("T", "brush; Shift or right drag takes away"),
                ("[   ]", "size of the brush"),
                ("S", "simplify the outlines"),
            ),
        ),
    ),
    (
        (
            "Images",
            (
                ("N   P", "next, previous"),
                ("U", "next one without an answer"),
                ("Home   End", "first, last"),
                ("F6", "the list"),
            ),
        ),
        (
            "Picture",
            (
                ("Wheel   +   \N{MINUS SIGN}", "zoom at the cursor"),
                ("Z   F", "close-up of the head, all"),
                ("Space + drag", "move"),
                (",  .   <  >   /", "contrast, light, reset"),
                ("L   K   H", "loupe, masks, algorithm"),
                ("F11   F1", "full screen, this page"),
            ),
        ),
    ),
)
_SHARES = (0.40, 0.32, 0.28)
_KEYS_WIDTH = (158.0, 96.0, 122.0)
_ROW = 28.0


class AnnotationHelp(QWidget):
    """Covers its parent; a click closes it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self.hide()
        self.setAccessibleName("Keys")
        rows = (row for column in KEY_COLUMNS for _, table in column for row in table)
        self.setAccessibleDescription("; ".join(f"{key}: {text}" for key, text in rows))
        parent.installEventFilter(self)

    def toggle(self) -> None:
        self.setGeometry(self._parent.rect())
        self.setVisible(not self.isVisible())
        self.raise_()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self.setGeometry(self._parent.rect())
        return False

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.hide()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), theme.colour(palette.INK, 0.78))
        page = QRectF(0, 0, min(1220, self.width() - 30), 460)
        page.moveCenter(QRectF(self.rect()).center())
        painter.setPen(QPen(QColor(palette.LINE), 1))
        painter.setBrush(QColor(palette.PANEL))
        painter.drawRoundedRect(page, 12, 12)
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.bold(22))
        painter.drawText(page.adjusted(32, 22, 0, 0), Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, "Keys")
        left = page.left() + 32
        for tables, share, keys_width in zip(KEY_COLUMNS, _SHARES, _KEYS_WIDTH, strict=True):
            width, top = (page.width() - 48) * share, page.top() + 66
            for title, rows in tables:
                top = _paint_table(painter, QRectF(left, top, width - 14, 0), title, rows, keys_width) + 12
            left += width
        painter.end()


def _paint_table(painter: QPainter, place: QRectF, title: str, rows: tuple[tuple[str, str], ...], keys_width: float) -> float:
    """Returns where it ends."""
    painter.setPen(QColor(palette.SKY))
    painter.setFont(theme.semi_bold(14))
    painter.drawText(QRectF(place.left(), place.top(), place.width(), 30), Qt.AlignmentFlag.AlignVCenter, title)
    top = place.top() + 32
    text_font = theme.font(13)
    for key, text in rows:
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.fitted(theme.semi_bold(13), key, int(keys_width - 6)))
        painter.drawText(QRectF(place.left(), top, keys_width, _ROW), Qt.AlignmentFlag.AlignVCenter, key)
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.setFont(theme.fitted(text_font, text, int(place.width() - keys_width)))
        painter.drawText(
            QRectF(place.left() + keys_width, top, place.width() - keys_width, _ROW), Qt.AlignmentFlag.AlignVCenter, text
        )
        top += _ROW
    return top

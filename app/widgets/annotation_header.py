"""Above the picture: which image, for whom, and whether everything is on the disk."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QWidget

from app import theme
from app.language import tr


class AnnotationHeader(QWidget):
    """Title on the left, study and rater in the middle, the state of the file on the right."""

    def __init__(self, who: str) -> None:
        super().__init__()
        self._title = QLabel()
        theme.set_sheet(self._title, "color: @TEXT; font-size: 17px; font-weight: 700;")
        self._title.setMinimumWidth(40)
        self._title.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._who = QLabel(who)
        theme.set_sheet(self._who, "color: @TEXT_DIM; font-size: 13px;")
        self._saved = QLabel()
        self._saved.setAccessibleName(tr("State of the file"))
        row = QHBoxLayout(self)
        row.setContentsMargins(4, 2, 4, 0)
        row.setSpacing(18)
        row.addWidget(self._title, 1)
        row.addWidget(self._who)
        row.addWidget(self._saved)
        self.show_saved(True)

    @property
    def saved_text(self) -> str:
        return self._saved.text()

    def show_title(self, text: str) -> None:
        self._title.setText(text)
        self._title.setToolTip(text)

    def show_saved(self, is_saved: bool) -> None:
        self._show(tr("\N{CHECK MARK}  saved") if is_saved else tr("saving"), "ALLOWED" if is_saved else "TEXT_DIM", "")

    def show_unsaved(self, count: int, why: str) -> None:
        """Edits that could not be written, and why."""
        self._show(
            tr("\N{WARNING SIGN}  NOT SAVED: 1 edit")
            if count == 1
            else tr("\N{WARNING SIGN}  NOT SAVED: {count} edits", count=count),
            "FAULT",
            why,
        )

    def _show(self, text: str, role: str, tip: str) -> None:
        self._saved.setText(text)
        self._saved.setToolTip(tip)
        theme.set_sheet(self._saved, f"color: @{role}; font-size: 13px; font-weight: 600;")

"""What all pages of the rig wizard have in common: a heading, what to do, and the wizard's desk."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app import theme
from app.language import tr, tr_text
from app.widgets.wizard_picture import Shape, WizardPicture
from app.wizard_desk import WizardDesk
from core.types import Image

_TEXT_PX = 400
"""A page's text is a little wider."""
_HEAD_PX = 28


class WizardPage(QWidget):
    """One step. ``name`` stands in the list of steps; the page adds its controls to ``column``."""

    name = ""
    hint = ""
    needs_servos = False

    def __init__(self, desk: WizardDesk, picture: WizardPicture) -> None:
        super().__init__()
        self.desk, self.picture = desk, picture
        self.still: Image | None = None
        """Shown instead of the living picture; None: that."""
        self.main: QPushButton | None = None
        """What the page is for; it stands out until that is done."""
        self.column = QVBoxLayout(self)
        self.column.setContentsMargins(0, 0, 0, 0)
        self.column.setSpacing(theme.GAP)
        title = QLabel(tr(self.name))
        title.setFont(theme.semi_bold(18))
        self.column.addWidget(title)
        self.column.addWidget(note(tr(self.hint)))

    @property
    def is_done(self) -> bool:
        """Whether the step has been done: it gets a tick, and Next is not called Skip."""
        return False

    @property
    def may_leave(self) -> bool:
        """Whether there is a next step."""
        return True

    def enter(self) -> None:
        """The page comes to the front."""
        self.refresh()

    def leave(self) -> None:
        """Another page comes to the front."""

    def refresh(self) -> None:
        """Show what is known now; called whenever a job begins or ends."""

    def shapes(self) -> Sequence[Shape]:
        """What is drawn over the picture."""
        return ()

    def click(self, x: float, y: float) -> None:
        """A place of the picture was clicked."""


def note(text: str) -> QLabel:
    """A text of several lines."""
    label = QLabel(text)
    label.setWordWrap(True)
    theme.set_sheet(label, "color: @TEXT_DIM;")
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label


def tell(label: QLabel, text: str) -> None:
    """Another text for a note, with the room for all its lines: a table beside it would take that otherwise."""
    label.setText(tr_text(text))
    label.setMinimumHeight(label.heightForWidth(_TEXT_PX) if text else 0)


def button(text: str, slot: Callable[[], object], tip: str = "") -> QPushButton:
    made = QPushButton(text)
    made.setToolTip(tip)
    made.setAutoDefault(False)
    made.clicked.connect(lambda _checked=False: slot())
    return made


def mark_main(which: QPushButton, is_main: bool) -> None:
    """Whether a button is what comes next."""
    name = "main_button" if is_main else ""
    if which.objectName() != name:
        which.setObjectName(name)
        which.style().unpolish(which)
        which.style().polish(which)


def table(headings: Sequence[str], rows: int, name: str) -> QTableWidget:
    """An empty table of texts; the last column takes what room is left."""
    made = QTableWidget(rows, len(headings))
    made.setHorizontalHeaderLabels(list(headings))
    made.verticalHeader().hide()
    made.setAccessibleName(name)
    made.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    made.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    made.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    made.setTabKeyNavigation(False)
    made.horizontalHeader().setFixedHeight(_HEAD_PX)
    made.horizontalHeader().setHighlightSections(False)
    made.horizontalHeader().setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    made.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    made.horizontalHeader().setStretchLastSection(True)
    return made


def fit(where: QTableWidget) -> None:
    """As high as its rows, so that what follows stands beneath them."""
    rows = where.rowCount() * where.verticalHeader().defaultSectionSize()
    where.setFixedHeight(_HEAD_PX + rows + 2 * max(1, where.frameWidth()))
    where.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)


def put(where: QTableWidget, row: int, column: int, text: str) -> None:
    """A text into a cell, which also is its tool tip."""
    item = QTableWidgetItem(text)
    item.setToolTip(text)
    where.setItem(row, column, item)

"""What a session is about, as fields: in the library, and as a dialog in the operator window and the player."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QCompleter, QDialog, QFormLayout, QLabel, QLineEdit, QPlainTextEdit, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr
from app.widgets.basics import column, line, takes_enter, text_button
from core.session.manifest import Description, changed_description

_LINES = {
    "operator": (mark("Operator"), mark("who recorded it")),
    "task": (mark("Task"), mark("what was done")),
    "condition": (mark("Condition"), mark("such as the arm of a study")),
    "phantom": (mark("Phantom"), mark("what lay before the camera")),
    "tags": (mark("Tags"), mark("separated by commas")),
}
"""Fields of one line: title, and what is meant."""
_OF_SESSION = ("tags", "notes")
"""Fields that belong to one session, and are not taken over into the next."""
_NOTES_PX = 66
_WIDTH_PX = 460


class DescriptionForm(QWidget):
    """Fields of a description. ``edited`` carries it when a field was left, or Enter pressed, and something has changed.

    Parameters
    ----------
    is_of_session : with tags and notes, which belong to one session.
    """

    edited = Signal(object)

    def __init__(self, *, is_of_session: bool = True) -> None:
        super().__init__()
        self._shown = Description()
        self.fields: dict[str, QLineEdit] = {}
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setSpacing(6)
        form.setLabelAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        for key, (title, hint) in _LINES.items():
            if key in _OF_SESSION and not is_of_session:
                continue
            field = self.fields[key] = QLineEdit()
            field.setPlaceholderText(tr(hint))
            field.editingFinished.connect(self._report)
            self._add(form, tr(title), field)
        self.notes = QPlainTextEdit()
        self.notes.setFixedHeight(_NOTES_PX)
        self.notes.setTabChangesFocus(True)
        self.notes.document().setDocumentMargin(8)  # as the lines above
        self.notes.installEventFilter(self)
        if is_of_session:
            self._add(form, tr("Notes"), self.notes)

    def _add(self, form: QFormLayout, title: str, field: QWidget) -> None:
        field.setAccessibleName(title)
        label = QLabel(title)
        label.setObjectName("setting_meaning")
        label.setBuddy(field)
        form.addRow(label, field)

    @property
    def description(self) -> Description:
        """As the fields have it; what has no field is as it was shown."""
        given: dict[str, object] = {key: field.text() for key, field in self.fields.items()}
        if "tags" in self.fields:
            given["notes"] = self.notes.toPlainText()
        return changed_description(self._shown, given)

    def show_description(self, description: Description) -> None:
        self._shown = description
        for key, field in self.fields.items():
            value = getattr(description, key)
            with QSignalBlocker(field):
                field.setText(value if isinstance(value, str) else ", ".join(value))
                field.setCursorPosition(0)
        self.notes.setPlainText(description.notes)

    def set_known(self, known: Iterable[Description]) -> None:
        """Complete what is typed by what other sessions have."""
        known = list(known)
        for key in ("operator", "task", "condition", "phantom"):
            completer = QCompleter(sorted({getattr(one, key) for one in known} - {""}), self.fields[key])
            completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
            self.fields[key].setCompleter(completer)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self.notes and event.type() == QEvent.Type.FocusOut:
            self._report()
        return False

    def _report(self) -> None:
        if (given := self.description) != self._shown:
            self._shown = given
            self.edited.emit(given)


class DescriptionDialog(QDialog):
    """Not modal: what is behind it goes on, and STOP stays within reach. ``given`` carries the description that is to be kept.

    Parameters
    ----------
    about : which recording, or which ones.
    is_of_session : see ``DescriptionForm``.
    """

    given = Signal(object)

    def __init__(self, parent: QWidget, about: str, description: Description, *, is_of_session: bool = True) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(tr("Description"))
        theme.set_sheet(self, theme.FORM_SHEET)
        self.form = DescriptionForm(is_of_session=is_of_session)
        self.form.show_description(description)
        self.form.setMinimumWidth(_WIDTH_PX)
        title = QLabel(about, wordWrap=True)
        title.setObjectName("setting_name")
        keep = text_button(tr("Keep"), self.accept)
        keep.setObjectName("main_button")
        buttons = line(text_button(tr("Cancel"), self.reject), keep, spacing=8)
        buttons.insertStretch(0, 1)
        self.setLayout(column(title, self.form, buttons, spacing=12, margins=(16, 14, 16, 14)))
        next(iter(self.form.fields.values())).setFocus()

    def accept(self) -> None:
        self.given.emit(self.form.description)
        super().accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter in a field keeps all; on a button it presses it."""
        if isinstance(self.focusWidget(), QLineEdit) and event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.accept()
        elif not takes_enter(self, event):
            super().keyPressEvent(event)

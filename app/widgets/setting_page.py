"""Settings below each other: a section of the configuration, or what a search has found in several."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QScrollArea, QVBoxLayout, QWidget

from app.language import tr
from app.settings_model import SettingsDraft
from app.widgets.setting_field import SettingField
from core.config_schema import Section, Setting

MOST_FOUND = 40
"""Fields that are made for a search; more say nothing that a longer word would not."""
_AT_ONCE = 7

Group = tuple[Section, Sequence[Setting]]


class SettingPage(QScrollArea):
    """Shows groups of settings of a draft. ``edited`` carries key and entry, the others what is to be reset."""

    edited = Signal(str, object)
    reset_asked = Signal(str)
    section_reset_asked = Signal(object)

    def __init__(self, draft: SettingsDraft) -> None:
        super().__init__()
        self._draft = draft
        self.fields: dict[str, SettingField] = {}
        self._section_errors: dict[str, QLabel] = {}
        self._section_notes: dict[str, QLabel] = {}
        self._section_buttons: dict[str, tuple[Section, QPushButton]] = {}
        self._column: QVBoxLayout | None = None
        self._waiting: list[Section | Setting | str] = []
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self._add_some)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName(tr("Settings of the section"))
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def show_groups(self, groups: Sequence[Group], empty: str = "") -> None:
        """These instead of the ones before; `empty` is said when there are none.

        What is in sight is there at once, the rest comes bit by bit: a long section would keep the window busy for too long.
        """
        self.fields, self._section_errors, self._section_notes, self._section_buttons = {}, {}, {}, {}
        page = QWidget()
        page.setObjectName("setting_page")
        column = QVBoxLayout(page)
        column.setContentsMargins(14, 4, 12, 14)
        column.setSpacing(6)
        column.addStretch(1)
        self.setWidget(page)
        self._column = column
        self._waiting = _parts(groups, empty)
        self._add_some()
        self.verticalScrollBar().setValue(0)

    def renew(self) -> None:
        """Show the draft as it is now."""
        draft = self._draft
        for key, field in self.fields.items():
            field.show_state(draft.entry(key), draft.value(key), is_changed=draft.is_changed(key), error=draft.error(key))
            field.setEnabled(not draft.is_kept(key))
        for key, label in self._section_notes.items():
            label.setText(tr("Kept in the rig file {path}: change it there, or by menu Rig, Calibrate", path=draft.rig_file))
            label.setVisible(draft.is_kept(key))
        for key, label in self._section_errors.items():
            error = draft.section_error(key)
            label.setText(f"\N{WARNING SIGN}  {error}" if error else "")
            label.setVisible(bool(error))
        for section, button in self._section_buttons.values():
            count = draft.changed_in(section)
            button.setEnabled(count > 0 and not draft.is_kept(section.key))
            button.setText(tr("Reset section ({count})", count=count) if count else tr("Reset section"))

    def add_all(self) -> None:
        """Everything that has not come yet."""
        while self._waiting:
            self._add_some()

    def go_to(self, key: str) -> None:
        """Bring a setting into sight and give it the focus."""
        self.add_all()
        layout = self._column
        if layout is not None:
            layout.activate()
        field = self.fields.get(key)
        if field is not None:
            self.ensureWidgetVisible(field, 0, 60)
            field.take_focus()

    def _add_some(self) -> None:
        """The next few, above the stretch at the end."""
        for part in self._waiting[:_AT_ONCE]:
            if isinstance(part, Section):
                self._add_head(part)
            elif isinstance(part, Setting):
                self._add_field(part)
            else:
                label = QLabel(part)
                label.setObjectName("setting_meaning")
                self._add(label)
        del self._waiting[:_AT_ONCE]
        self.renew()
        self._make_room()
        if self._waiting:
            self._soon.start()

    def _make_room(self) -> None:
        """All that is there gets its height now: left to Qt it would be painted squeezed together once, and then pulled apart."""
        page, column = self.widget(), self._column
        assert column is not None
        for part in page.findChildren(QWidget):
            part.ensurePolished()
        column.activate()
        width = self.viewport().width()
        page.resize(width, max(self.viewport().height(), column.totalHeightForWidth(width)))

    def _add(self, part: QWidget) -> None:
        assert self._column is not None
        self._column.insertWidget(self._column.count() - 1, part)
        part.show()  # Qt does it later, and until then the column has no room for it

    def _add_head(self, section: Section) -> None:
        title, meaning = QLabel(tr(section.title)), QLabel(tr(section.description).replace("``", ""))
        note, error = QLabel(), QLabel()
        title.setObjectName("section_title")
        title.setIndent(0)
        for label, name in ((meaning, "setting_meaning"), (note, "setting_meaning"), (error, "setting_error")):
            label.setObjectName(name)
            label.setWordWrap(True)
        button = QPushButton(tr("Reset section"))
        button.setAccessibleName(tr("Reset section {title}", title=tr(section.title)))
        button.clicked.connect(lambda _on=False: self.section_reset_asked.emit(section))
        head = QWidget()
        row = QHBoxLayout(head)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(title)
        row.addStretch(1)
        row.addWidget(button)
        for widget in (head, meaning, note, error):
            self._add(widget)
        note.hide()
        error.hide()
        self._section_notes[section.key] = note
        self._section_errors[section.key] = error
        self._section_buttons[section.key] = (section, button)

    def _add_field(self, setting: Setting) -> None:
        field = SettingField(setting, self._draft.default_value(setting.key))
        field.edited.connect(self.edited)
        field.reset_asked.connect(self.reset_asked)
        self.fields[setting.key] = field
        self._add(field)


def _parts(groups: Sequence[Group], empty: str) -> list[Section | Setting | str]:
    """Heads, settings and a last word, in the order of the page."""
    parts: list[Section | Setting | str] = []
    left = MOST_FOUND if len(groups) > 1 else 10_000
    for section, settings in groups:
        if left > 0:
            parts += [section, *settings[:left]]
        left -= len(settings)
    said = empty if not groups else tr("{count} more: add a word", count=-left) if left < 0 else ""
    return [*parts, said] if said else parts

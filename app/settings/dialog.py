"""The settings dialog: the whole configuration, section by section, generated from its schema. STOP works while it is open."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QPoint, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QKeyEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QDialog,
    QFrame,
    QLabel,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.settings.draft import SettingsDraft, search
from app.settings.fields import SettingField
from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.widgets.basics import column, holder, line, takes_enter
from app.widgets.messages import QuestionStrip
from core.config.models import Config
from core.config.schema import Effect, Section, Setting, schema, settings_by_key

MOST_FOUND = 40
"""Fields that are made for a search; more say nothing that a longer word would not."""
_AT_ONCE = 7

Group = tuple[Section, Sequence[Setting]]


class SettingPage(QScrollArea):
    """Settings of a draft below each other: a section, or what a search has found in several.

    ``edited`` carries key and entry, ``reset_asked`` the keys of a setting or of a section.
    """

    edited = Signal(str, object)
    reset_asked = Signal(object)

    def __init__(self, draft: SettingsDraft) -> None:
        super().__init__()
        self._draft = draft
        self.fields: dict[str, SettingField] = {}
        self._section_errors: dict[str, QLabel] = {}
        self._section_notes: dict[str, QLabel] = {}
        self._section_buttons: dict[str, tuple[Section, QPushButton]] = {}
        self._column: QVBoxLayout | None = None
        self._waiting: list[Section | Setting | str] = []
        self._soon = QTimer(self, singleShot=True)
        self._soon.timeout.connect(self._add_some)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName(tr("Settings of the section"))
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def show_groups(self, groups: Sequence[Group], empty: str = "") -> None:
        """Show these groups, or the text `empty` in place of no groups.

        What is in sight is made at once, the rest bit by bit: a long section would block the window for too long.
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
        left = MOST_FOUND if len(groups) > 1 else 10_000
        self._waiting = []
        for section, settings in groups:
            if left > 0:
                self._waiting += [section, *settings[:left]]
            left -= len(settings)
        if last := empty if not groups else tr("{count} more: add a word", count=-left) if left < 0 else "":
            self._waiting.append(last)
        self._add_some()
        self.verticalScrollBar().setValue(0)

    def update_fields(self) -> None:
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
        """Make everything that is still waiting."""
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
            field.editor.setFocus()

    def _add_some(self) -> None:
        """Make the next few, above the stretch at the end."""
        for part in self._waiting[:_AT_ONCE]:
            if isinstance(part, Section):
                self._add_head(part)
            elif isinstance(part, Setting):
                field = SettingField(part, self._draft.default_value(part.key))
                field.edited.connect(self.edited)
                field.reset_asked.connect(lambda key: self.reset_asked.emit([key]))
                self.fields[part.key] = field
                self._add(field)
            else:
                label = QLabel(part)
                label.setObjectName("setting_meaning")
                self._add(label)
        del self._waiting[:_AT_ONCE]
        self.update_fields()
        # Everything gets its height now: left to Qt it would be painted squeezed together once, and then pulled apart.
        page, column = self.widget(), self._column
        assert column is not None
        for child in page.findChildren(QWidget):
            child.ensurePolished()
        column.activate()
        width = self.viewport().width()
        page.resize(width, max(self.viewport().height(), column.totalHeightForWidth(width)))
        if self._waiting:
            self._soon.start()

    def _add(self, part: QWidget) -> None:
        assert self._column is not None
        self._column.insertWidget(self._column.count() - 1, part)
        part.show()  # Qt does it later, and until then the column has no room for it

    def _add_head(self, section: Section) -> None:
        title, meaning = QLabel(self._draft.title(section)), QLabel(tr(section.description).replace("``", ""))
        note, error = QLabel(), QLabel()
        title.setObjectName("section_title")
        title.setIndent(0)
        for label, name in ((meaning, "setting_meaning"), (note, "setting_meaning"), (error, "setting_error")):
            label.setObjectName(name)
            label.setWordWrap(True)
        button = QPushButton(tr("Reset section"))
        button.setAccessibleName(tr("Reset section {title}", title=title.text()))
        keys = [setting.key for setting in section.all_settings()]
        button.clicked.connect(lambda _on=False: self.reset_asked.emit(keys))
        for widget in (holder(line((title, 1), button)), meaning, note, error):
            self._add(widget)
        note.hide()
        error.hide()
        self._section_notes[section.key] = note
        self._section_errors[section.key] = error
        self._section_buttons[section.key] = (section, button)


_SIZE = (900, 660)
_LEAST = (700, 420)
_SEARCH_AFTER_MS = 150
_ROW_PX = 26
_TREE_PX = 204
_MOST_SHARE, _MARGIN_PX = 0.57, 40
_KEY_ROLE = Qt.ItemDataRole.UserRole


class SettingsDialog(QDialog):
    """Edits a draft; the settings file is written by its owner.

    ``drafted`` carries the configuration whenever it changes and is allowed, for the preview, ``save_asked`` whether the rig is to
    be started again. Esc with unsaved changes asks before it closes, since it is often meant for a field; Cancel does not ask.

    Parameters
    ----------
    draft : what is edited.
    path : of the settings file, to be shown.
    problems : what was wrong with the file, one line each.
    """

    drafted = Signal(object)
    save_asked = Signal(bool)

    def __init__(
        self,
        draft: SettingsDraft,
        path: Path,
        problems: tuple[str, ...] = (),
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.draft, self._path = draft, path
        self._locked = ""
        self._running: Config | None = None
        self._section: Section = schema().sections[0]
        self.search = QLineEdit()
        self.tree = QTreeWidget()
        self.page = SettingPage(draft)
        self.status, self.notice = QLabel(), QLabel()
        self.reset_all, self.cancel = QPushButton(tr("Reset all")), QPushButton(tr("Cancel"))
        self.question = QuestionStrip(self.status, self.reset_all, self.cancel)
        """Of leaving or resetting; it has a Cancel of its own, which keeps the dialog open."""
        self.save, self.save_and_restart = QPushButton(tr("Save")), QPushButton(tr("Save, and start the rig again"))
        self._items: dict[str, QTreeWidgetItem] = {}
        self._search_soon = QTimer(self, singleShot=True, interval=_SEARCH_AFTER_MS)
        self.setObjectName("settings")
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} settings"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._lay_out()
        self._fill_tree()
        self._wire()
        self.show_notice("\n".join(map(tr_text, problems)), is_fault=True)
        self.show_section(self._section)
        self.setMinimumSize(*_LEAST)
        self.resize(*_SIZE)

    # ---- what is shown

    def show_section(self, section: Section) -> None:
        """The settings of a section; of one that only holds others, those too."""
        self._section = section
        groups = [(section, section.settings)] if section.settings else [(part, part.settings) for part in section.sections]
        self.page.show_groups([group for group in groups if self.draft.title(group[0])])
        item = self._items.get(section.key)
        if item is not None and self.tree.currentItem() is not item:
            self.tree.setCurrentItem(item)
        self._update()

    def stand_beside(self, window: QWidget, kept_clear: QWidget) -> None:
        """Place it at the right edge of a window, so that most of the picture and all of `kept_clear` (STOP) stay in sight."""
        frame = window.frameGeometry()
        width = max(_LEAST[0], min(_SIZE[0], round(frame.width() * _MOST_SHARE)))
        top = frame.top() + _MARGIN_PX
        room = kept_clear.mapToGlobal(QPoint(0, 0)).y() - top - _MARGIN_PX
        self.resize(width, max(_LEAST[1], min(_SIZE[1], room)))
        self.move(frame.right() - width - 10, top)

    def go_to(self, key: str) -> None:
        """Show a setting, or a section, and give it the focus."""
        sections = {section.key: section for section in schema().walk()}
        section = sections.get(key) or sections.get(key.rpartition(".")[0])
        if section is None:
            return
        self.page.add_all()
        if key not in self.page.fields:
            self._leave_search()
            self.show_section(section)
        self.page.go_to(key)

    def show_notice(self, text: str, *, is_fault: bool = False) -> None:
        """A line above the settings: what was wrong with the file, what could not be done."""
        self.notice.setText(f"\N{WARNING SIGN}  {text}" if text and is_fault else text)
        self.notice.setObjectName("setting_error" if is_fault else "setting_meaning")
        self.notice.style().unpolish(self.notice)
        self.notice.style().polish(self.notice)
        self.notice.setVisible(bool(text))

    def follow_theme(self) -> None:
        self.status.setText("")  # a link keeps the colour that it was laid out with
        self._update()

    def lock(self, why: str) -> None:
        """Allow no changes for this reason; empty: allow them."""
        if why != self._locked:
            self._locked = why
            for widget in (self.page, self.reset_all):
                widget.setEnabled(not why)
            if why:
                self.question.cancel()  # its answer would change them
            self._update()

    def show_rig(self, running: Config) -> None:
        """What the rig file of the running configuration keeps is shown as it is in force, and is not changed here."""
        if running is not self._running:
            self._running = running
            self.draft.show_rig(running)
            self._update()

    # ---- edits

    def _on_edited(self, key: str, entry: object) -> None:
        self.draft.set_entry(key, entry)
        self._changed()

    def _on_reset(self, keys: list[str]) -> None:
        self.draft.reset(keys)
        self._changed()

    def _ask_reset_all(self) -> None:
        self.question.ask(tr("Put all settings back to their defaults?"), tr("Reset all"), self._reset_everything)

    def _reset_everything(self) -> None:
        self.draft.load(self.draft.default)
        self._changed()

    def _changed(self) -> None:
        self._update()
        if self.draft.config is not None:
            self.drafted.emit(self.draft.config)

    def _update(self) -> None:
        """Fields, marks, the line below and the buttons, as the draft is."""
        self.page.update_fields()
        for section in schema().walk():
            if section.key:
                count, is_wrong = self.draft.changed_in(section), self.draft.is_wrong_in(section)
                mark = "\N{WARNING SIGN}" if is_wrong else f"\N{BLACK CIRCLE} {count}" if count else ""
                item, title = self._items[section.key], self.draft.title(section)
                if (item.text(0), item.text(1)) == (title, mark) and item.toolTip(0):
                    continue
                item.setHidden(not title)
                item.setText(0, title)
                item.setText(1, mark)
                words = tr("{count} differ from the default", count=count) if count else tr("as by default")
                words = tr("something is not allowed") if is_wrong else words
                item.setToolTip(0, f"{section.key}: {words}")
                item.setData(0, Qt.ItemDataRole.AccessibleTextRole, f"{title}, {words}")
        effects = self.draft.effects()
        may_save = not self._locked and self.draft.config is not None and self.draft.is_dirty
        self.save.setEnabled(may_save)
        self.save_and_restart.setVisible(Effect.RIG in effects)
        self.save_and_restart.setEnabled(may_save)
        self.reset_all.setEnabled(not self._locked and any(map(self._can_reset, settings_by_key())))
        self.status.setText(self._status(effects))

    def _can_reset(self, key: str) -> bool:
        return self.draft.is_changed(key) and not self.draft.is_kept(key)

    def _status(self, effects: set[Effect]) -> str:
        if self._locked:
            return f"\N{WARNING SIGN}  {self._locked}"
        problem = self.draft.first_problem
        if problem is not None:
            return f'\N{WARNING SIGN}  <a href="{problem[0]}">{_shown_name(problem[0])}</a>: {problem[1].replace(" °", "°")}'
        if not self.draft.is_dirty:
            return tr("Saved in {path}", path=self._path)
        count = len(self.draft.unsaved_keys())
        parts = [tr("{count} not saved", count=count)]
        if Effect.NOW in effects:
            parts.append(tr("the picture shows it already; Cancel puts it back"))
        if Effect.RIG in effects:
            parts.append(tr("some act when the rig is started again"))
        if Effect.PROGRAM in effects:
            parts.append(tr("some when the program is started again"))
        return "; ".join(parts)

    # ---- searching

    def _run_search(self) -> None:
        words = self.search.text().strip()
        if not words:
            self.show_section(self._section)
            return
        self.tree.clearSelection()
        found = [group for group in search(words) if self.draft.title(group[0])]
        self.page.show_groups(found, tr("Nothing has {words} in its name, meaning or unit", words=words))

    def _on_tree(self) -> None:
        item = self.tree.currentItem()
        if item is not None and item.isSelected():
            key = item.data(0, _KEY_ROLE)
            self._leave_search()
            self.show_section(next(section for section in schema().walk() if section.key == key))

    def _leave_search(self) -> None:
        self.search.clear()
        self._search_soon.stop()

    # ---- keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if takes_enter(self, event):
            return
        if event.key() != Qt.Key.Key_Escape:
            super().keyPressEvent(event)
        elif not event.isAutoRepeat():
            self._on_escape()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.reject()  # without a question, which would keep the program from ending, too
        super().closeEvent(event)

    def ask_to_leave(self) -> None:
        """Close the dialog; with something changed and not saved only after a question."""
        if not self.draft.is_dirty:
            self.reject()
        elif not self.question.text:
            self.question.ask(tr("Leave without saving the changes?"), tr("Leave"), self.reject)

    def _on_escape(self) -> None:
        """Back by one step: a question, the search, the dialog."""
        if self.question.text:
            self.question.cancel()
        elif self.search.text():
            self.search.clear()
        else:
            self.ask_to_leave()

    # ---- places

    def _wire(self) -> None:
        self.search.textChanged.connect(lambda _text: self._search_soon.start())
        self._search_soon.timeout.connect(self._run_search)
        self.tree.itemSelectionChanged.connect(self._on_tree)
        self.page.edited.connect(self._on_edited)
        self.page.reset_asked.connect(self._on_reset)
        self.status.linkActivated.connect(self.go_to)
        self.reset_all.clicked.connect(lambda _on=False: self._ask_reset_all())
        self.cancel.clicked.connect(lambda _on=False: self.reject())
        self.save.clicked.connect(lambda _on=False: self.save_asked.emit(False))
        self.save_and_restart.clicked.connect(lambda _on=False: self.save_asked.emit(True))
        QShortcut(QKeySequence.StandardKey.Find, self).activated.connect(self.search.setFocus)

    def _fill_tree(self) -> None:
        def add(parent: QTreeWidget | QTreeWidgetItem, section: Section) -> None:
            item = QTreeWidgetItem(parent, [tr(section.title), ""])
            item.setData(0, _KEY_ROLE, section.key)
            item.setSizeHint(0, QSize(0, _ROW_PX))
            item.setTextAlignment(1, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            self._items[section.key] = item
            for part in section.sections:
                add(item, part)

        for section in schema().sections:
            add(self.tree, section)
        self._items["perception"].setExpanded(True)

    def _lay_out(self) -> None:
        self.search.setPlaceholderText(tr("Search (Ctrl+F); Space may be STOP"))
        self.search.setToolTip(tr("Search name, meaning, unit (Ctrl+F); Space is STOP while the robot can move"))
        self.search.setAccessibleName(tr("Search settings"))
        self.search.setClearButtonEnabled(True)
        self.tree.setColumnCount(2)
        self.tree.setHeaderHidden(True)
        self.tree.header().setStretchLastSection(False)
        self.tree.header().setMinimumSectionSize(0)
        self.tree.header().setSectionResizeMode(0, self.tree.header().ResizeMode.Stretch)
        self.tree.header().setSectionResizeMode(1, self.tree.header().ResizeMode.ResizeToContents)
        self.tree.setAccessibleName(tr("Sections"))
        self.tree.setIndentation(14)
        self.notice.setWordWrap(True)
        self.status.setWordWrap(True)
        self.status.setObjectName("setting_meaning")
        self.status.setAccessibleName(tr("State of the settings"))
        self.splitter = QSplitter(Qt.Orientation.Horizontal)
        self.splitter.addWidget(self.tree)
        self.splitter.addWidget(self.page)
        self.splitter.setChildrenCollapsible(False)
        self.splitter.setStretchFactor(1, 1)
        self.splitter.setSizes([_TREE_PX, _SIZE[0] - _TREE_PX])
        self.save.setObjectName("main_button")
        buttons = self.reset_all, self.cancel, self.save, self.save_and_restart
        bottom = line((self.status, 1), (self.question, 1), *buttons, spacing=8)
        self.setLayout(column(self.search, self.notice, (self.splitter, 1), bottom, spacing=8, margins=(theme.GAP,) * 4))
        for button in self.findChildren(QPushButton):
            button.setAutoDefault(False)


def _shown_name(key: str) -> str:
    """What a setting or a section is called on the page."""
    setting = settings_by_key().get(key)
    section = next((one for one in schema().walk() if one.key == (key.rpartition(".")[0] if setting is not None else key)), None)
    return ", ".join(tr(one.title) for one in (section, setting) if one is not None and one.title)

"""Profiles: choose one, save the settings under a name, delete one. Questions are asked in the row itself, never in a box."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QLineEdit, QPushButton, QStackedLayout, QWidget

from app.language import mark, tr
from app.widgets.question_strip import QuestionStrip
from app.widgets.quiet_combo import QuietCombo
from core.profiles import Profile

_OWN = mark("Own settings")


class ProfileRow(QWidget):
    """Asks only; ``chosen`` carries a profile, ``save_asked`` a name, ``delete_asked`` the profile that was confirmed."""

    chosen = Signal(object)
    save_asked = Signal(str)
    delete_asked = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.combo = QuietCombo(tr("Profile"), keeps_focus=True)
        self.combo.setMinimumWidth(190)
        self.combo.setToolTip(tr("Takes all settings from a profile; nothing is kept before you save"))
        self.save_button, self.delete_button = QPushButton(tr("Save as")), QPushButton(tr("Delete"))
        self.name = QLineEdit()
        self.name.setPlaceholderText(tr("Name of the profile; Enter saves, Esc does not"))
        self.name.setAccessibleName(tr("Name of the profile"))
        self.name.setMaxLength(60)
        self.question = QuestionStrip()
        self._profiles: tuple[Profile, ...] = ()
        self._lay_out()
        self.combo.activated.connect(self._on_activated)
        self.save_button.clicked.connect(self.begin_naming)
        self.delete_button.clicked.connect(self._ask_delete)
        self.name.returnPressed.connect(self._on_named)
        self.question.closed.connect(self.end_asking)

    def show_profiles(self, profiles: tuple[Profile, ...], current: Profile | None) -> None:
        """All there are, and the one that says exactly what is edited; None: none does."""
        self._profiles = profiles
        with QSignalBlocker(self.combo):
            self.combo.clear()
            self.combo.addItem(tr(_OWN), None)
            for profile in profiles:
                self.combo.addItem(tr("{name} (preset)", name=profile.name) if profile.is_preset else profile.name, profile.name)
        self.show_current(current)

    def show_current(self, current: Profile | None) -> None:
        with QSignalBlocker(self.combo):
            self.combo.setCurrentIndex(self._profiles.index(current) + 1 if current in self._profiles else 0)
        profile = self.profile
        self.delete_button.setEnabled(profile is not None and not profile.is_preset)
        self.delete_button.setToolTip("" if self.delete_button.isEnabled() else tr("Choose one of your own profiles first"))

    @property
    def profile(self) -> Profile | None:
        """The one that is chosen."""
        place = self.combo.currentIndex()
        return self._profiles[place - 1] if place > 0 else None

    @property
    def is_asking(self) -> bool:
        return self._stack.currentIndex() != 0

    def begin_naming(self) -> None:
        """Ask for a name."""
        profile = self.profile
        self.name.setText(profile.name if profile is not None and not profile.is_preset else "")
        self._stack.setCurrentWidget(self.name)
        self.name.setFocus()
        self.name.selectAll()

    def ask(self, question: str, answer: str, action: object) -> None:
        """A question in place of the row."""
        self._stack.setCurrentWidget(self.question)
        self.question.ask(question, answer, action)  # type: ignore[arg-type]

    def end_asking(self) -> None:
        """The row as it was."""
        self._stack.setCurrentIndex(0)

    def _on_activated(self, place: int) -> None:
        if place > 0:
            self.chosen.emit(self._profiles[place - 1])

    def _on_named(self) -> None:
        name = self.name.text()
        self.end_asking()
        self.save_asked.emit(name)

    def _ask_delete(self) -> None:
        profile = self.profile
        if profile is not None:
            self.ask(tr("Delete the profile {name}?", name=profile.name), tr("Delete"), lambda: self.delete_asked.emit(profile))

    def _lay_out(self) -> None:
        buttons = QWidget()
        row = QHBoxLayout(buttons)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        label = QLabel(tr("Profile"))
        label.setObjectName("card_title")
        row.addWidget(label)
        row.addWidget(self.combo, 1)
        row.addWidget(self.save_button)
        row.addWidget(self.delete_button)
        self._stack = QStackedLayout(self)
        for widget in (buttons, self.name, self.question):
            self._stack.addWidget(widget)
        self.setFixedHeight(36)

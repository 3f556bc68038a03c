"""Choice of the phantom that the bench twin shows."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QWheelEvent
from PySide6.QtWidgets import QSpinBox, QWidget

from app.ui.actions import MenuEntry
from app.ui.i18n import tr, tr_text
from app.ui.texts import tip
from app.widgets.basics import QuietCombo, card_title, line, text_button

_RANDOM = "random"
_SEED_MAX = 999_999


class PhantomPicker(QWidget):
    """Named phantoms, and "Random" with a seed. ``chosen`` carries the phantom's name as the configuration writes it."""

    chosen = Signal(str)

    def __init__(self, phantoms: Sequence[tuple[str, str]], current: str) -> None:
        """`phantoms` are (name, title) pairs; `current` is a name or "random:<seed>"."""
        super().__init__()
        self._combo = QuietCombo(tr("Phantom"))
        for name, title in phantoms:
            self._combo.addItem(tr_text(title), name)
        self._combo.addItem(tr("Random \N{HORIZONTAL ELLIPSIS}"), _RANDOM)
        self._combo.setMinimumWidth(190)
        self._combo.setMaxVisibleItems(16)
        self._combo.setToolTip(tip("phantom") + "\n" + tr("Ctrl+P opens the list; so does Enter when Tab has come here"))
        self._seed = _SeedBox()
        roll = text_button(tr("New"), self.roll, tr("Another random phantom (key R)"), tr("Another random phantom"))
        self.setLayout(line(card_title(tr("Phantom")), self._combo, self._seed, roll, spacing=6))
        self.show_name(current)
        self._combo.activated.connect(self._on_choice)
        self._seed.committed.connect(self._on_choice)

    @property
    def name(self) -> str:
        """The phantom as the configuration writes it."""
        return f"{_RANDOM}:{self._seed.value()}" if self._is_random else str(self._combo.currentData())

    @property
    def title(self) -> str:
        return tr("random {seed}", seed=self._seed.value()) if self._is_random else self._combo.currentText()

    @property
    def _is_random(self) -> bool:
        return bool(self._combo.currentData() == _RANDOM)

    def show_name(self, name: str) -> None:
        """Show `name` without choosing it again."""
        kind, _, seed = name.partition(":")
        with QSignalBlocker(self._combo):
            self._combo.setCurrentIndex(self._combo.findData(kind if kind == _RANDOM else name))
        if kind == _RANDOM and seed.isdecimal():
            self._seed.show_seed(int(seed))
        self._enable_seed()

    def menu_entries(self) -> tuple[MenuEntry, ...]:
        return (
            MenuEntry(tr("Choose a &phantom"), self.open_list, ("Ctrl+P",)),
            MenuEntry(tr("Another ran&dom phantom"), self.roll, ("R",)),
        )

    def open_list(self) -> None:
        """The list of phantoms by keyboard: the arrows move, Enter chooses, Escape closes."""
        if not self.isEnabled():
            return
        self._combo.setFocus()
        self._combo.showPopup()

    def abandon(self) -> None:
        """Drop a seed that was typed and not confirmed."""
        self._seed.abandon()

    def roll(self) -> None:
        """The random phantom of the next seed; nothing while a rig without phantoms is open."""
        if not self.isEnabled():
            return
        if self._is_random:
            self._seed.show_seed(self._seed.value() % _SEED_MAX + 1)
        with QSignalBlocker(self._combo):
            self._combo.setCurrentIndex(self._combo.findData(_RANDOM))
        self._on_choice()

    def _on_choice(self) -> None:
        self._enable_seed()
        self.chosen.emit(self.name)

    def _enable_seed(self) -> None:
        self._seed.setEnabled(self._is_random)  # kept in place when unused, so that the row does not jump


class _SeedBox(QSpinBox):
    """A seed that counts when it is confirmed: Enter confirms, Escape drops what was typed; both give the keys to the robot."""

    committed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setRange(0, _SEED_MAX)
        self.setValue(1)
        self.setPrefix(tr("seed "))
        self.setFixedWidth(104)
        self.setButtonSymbols(QSpinBox.ButtonSymbols.NoButtons)
        self.setKeyboardTracking(False)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(tr("Seed of the random phantom"))
        self.setToolTip(tip("seed"))
        self._last = self.value()
        self.valueChanged.connect(self._on_value)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.abandon()
            self.clearFocus()
            return
        super().keyPressEvent(event)
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.clearFocus()

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()

    def show_seed(self, seed: int) -> None:
        """Show a seed that counts already; the one before it, typed again, counts as a new one."""
        with QSignalBlocker(self):
            self.setValue(seed)
        self._last = self.value()

    def abandon(self) -> None:
        """Show the value again instead of what was typed, which leaving the field would confirm."""
        self.lineEdit().setText(self.prefix() + self.textFromValue(self.value()))

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.selectAll()

    def _on_value(self, value: int) -> None:
        if value != self._last:
            self._last = value
            self.committed.emit()

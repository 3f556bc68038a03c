"""What the bench twin shows: the operator chooses its phantom and its look, and the twin is opened again with them.

The Twin menu: which phantom the bench twin shows, and how its picture looks: clear, or as on another kind of rig.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu

from app.ui.actions import MenuEntry, add_menu, plain
from app.ui.i18n import mark, tr, tr_text
from core.config.models import TwinConfig
from hardware.rig import RigKind, kind_of
from hardware.twin.catalog import BENCH_LOOK, BENCH_TITLE, LOOK_TITLES, RARE_TITLES, look_of

if TYPE_CHECKING:
    from app.operator.window import OperatorWindow
    from app.widgets.phantom_picker import PhantomPicker


_ANY = mark("Any of the ten &families")
_SEED_MAX = 999_999


class LookMenu(QObject):
    """Lists the looks; ``chosen`` carries what changes of the twin's configuration, and what to say of it.

    Parameters
    ----------
    current : the twin as it is configured now.
    has_twin : whether the open rig is the twin; else nothing can be chosen.
    phantoms : the entries that choose its phantom.
    """

    chosen = Signal(dict, str)

    def __init__(
        self,
        window: QMainWindow,
        current: Callable[[], TwinConfig],
        has_twin: Callable[[], bool],
        phantoms: Sequence[MenuEntry],
    ) -> None:
        super().__init__(window)
        self._current, self._has_twin = current, has_twin
        usual: list[tuple[str | None, str]] = [(BENCH_LOOK, BENCH_TITLE), (None, _ANY), *LOOK_TITLES.items()]
        lists: list[list[tuple[str | None, str]]] = [usual, [*RARE_TITLES.items()]]
        entries: list[MenuEntry | None] = [*phantoms, None, MenuEntry(tr("Another &look"), self.roll, ("L",))]
        for looks in lists:
            entries.append(None)
            entries += [MenuEntry(tr_text(title), partial(self._choose, look), checked=False) for look, title in looks]
        actions = add_menu(window, tr("&Twin"), entries)
        menus = [one for one in actions[0].associatedObjects() if isinstance(one, QMenu)]
        self._actions = actions
        names = [look for looks in lists for look, _title in looks]
        self._looks = dict(zip(names, actions[-len(names) :], strict=True))
        group = QActionGroup(self)
        # None is marked where the configuration names one that is unknown.
        group.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)
        for action in self._looks.values():
            group.addAction(action)
        menus[0].aboutToShow.connect(self.renew)
        self.renew()

    def renew(self) -> None:
        """Mark the look in use; nothing can be chosen while another rig is open."""
        for action in self._actions:
            action.setEnabled(self._has_twin())
        current = look_of(self._current())
        for look, action in self._looks.items():
            action.setChecked(look == current)

    def roll(self) -> None:
        """Another picture of this look. The clear bench has only one: any of the ten families, then."""
        if self._has_twin():
            twin = self._current()
            look = look_of(twin)
            self._change(None if look == BENCH_LOOK else look, twin.appearance_seed % _SEED_MAX + 1)

    def _choose(self, look: str | None) -> None:
        if self._has_twin():
            self._change(look, self._current().appearance_seed or 1)
        self.renew()

    def _change(self, look: str | None, seed: int) -> None:
        title = plain(self._looks[look].text()) if look in self._looks else str(look)
        self.chosen.emit({"look": look, "appearance_seed": seed}, title)


class TwinMenuController(QObject):
    """Lives as long as the window. Nothing is broken off for a choice: its keys lie among those that drive."""

    def __init__(self, window: OperatorWindow, picker: PhantomPicker) -> None:
        super().__init__(window)
        self._window, self._picker = window, picker
        self._looks = LookMenu(window, lambda: window.config.twin, self._is_open, picker.menu_entries())
        picker.chosen.connect(self._choose_phantom)
        self._looks.chosen.connect(self._choose_look)

    @Slot()
    def renew(self) -> None:
        """Another rig is being opened: whether there is anything to choose."""
        self._looks.renew()

    def _is_open(self) -> bool:
        return kind_of(self._window.config.rig) is RigKind.SIM

    @Slot(str)
    def _choose_phantom(self, name: str) -> None:
        if why := self._window.at_work():
            self._window.say(tr("The phantom stays as it is: {why}", why=why), is_fault=True)
            self._picker.show_name(self._window.config.twin.phantom)
        else:
            self._change({"phantom": name})

    @Slot(dict, str)
    def _choose_look(self, change: dict[str, Any], title: str) -> None:
        if why := self._window.at_work():
            self._window.say(tr("The look stays as it is: {why}", why=why), is_fault=True)
        else:
            self._change(change)
            self._window.say(tr("Look: {title}", title=title))

    def _change(self, change: dict[str, Any]) -> None:
        config = self._window.config
        self._window.panels.live.setFocus()
        self._window.use_config(config.model_copy(update={"twin": config.twin.model_copy(update=change)}))

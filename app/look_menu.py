"""The Twin menu: which phantom the bench twin shows, and how its picture looks: clear, or as on another kind of rig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu

from app.language import mark, tr, tr_text
from app.menus import MenuEntry, add_menu, plain
from core.config import TwinConfig
from hardware.twin.look_titles import BENCH_LOOK, BENCH_TITLE, LOOK_TITLES, RARE_TITLES, look_of

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

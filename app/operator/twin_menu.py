"""The Twin menu: which phantom the bench twin shows, and its look. The twin is opened again with what was chosen."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

from pydantic import ValidationError
from PySide6.QtCore import QObject
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu

from app.operator.panels import OperatorPanels
from app.operator.rig_session import RigSession
from app.ui.actions import MenuEntry, add_menu, plain
from app.ui.i18n import mark, tr, tr_text
from app.ui.layout_state import layout_settings
from core.config.models import Config, TwinConfig
from hardware.rig import RigKind, kind_of
from hardware.twin.catalog import BENCH_LOOK, BENCH_TITLE, LOOK_TITLES, LOOKS, OWN_LOOK, OWN_TITLE, RARE_TITLES, family_of, look_of
from hardware.twin.phantom import PHANTOM_TITLES, own_file

_ANY = mark("Any of the ten &families")
_SEED_MAX = 999_999
_KEPT = "twin"
"""Where the choice is kept until the next start."""


def with_kept_twin(config: Config) -> Config:
    """The configuration with the phantom and the look that were chosen last; a choice that is not known any more is ignored."""
    settings = layout_settings()
    kept = {name: settings.value(f"{_KEPT}/{name}") for name in ("phantom", "look", "appearance_seed")}
    kept = {name: value or None for name, value in kept.items() if value is not None}
    try:
        twin = TwinConfig.model_validate(config.twin.model_dump() | kept)
    except ValidationError:
        return config
    if (own := own_file(twin.phantom)) is not None and not own.is_file():
        return config
    if own is None and twin.phantom not in PHANTOM_TITLES and re.fullmatch(r"random:\d{1,6}", twin.phantom) is None:
        return config
    return config.model_copy(update={"twin": twin}) if twin.look is None or twin.look in LOOKS else config


class TwinMenuController(QObject):
    """Lives as long as the window. A choice breaks nothing off: its keys are next to those that drive.

    Parameters
    ----------
    window : gets the menu.
    say : shows a line, and whether it is a fault.
    """

    def __init__(self, window: QMainWindow, rig: RigSession, panels: OperatorPanels, say: Callable[[str, bool], None]) -> None:
        super().__init__(window)
        assert panels.picker is not None
        self._rig, self._live, self._picker, self._say = rig, panels.live, panels.picker, say
        usual: list[tuple[str | None, str]] = [(BENCH_LOOK, BENCH_TITLE), (OWN_LOOK, OWN_TITLE), (None, _ANY), *LOOK_TITLES.items()]
        entries: list[MenuEntry | None] = [*self._picker.menu_entries(), None, MenuEntry(tr("Another &look"), self.vary, ("L",))]
        for looks in (usual, [*RARE_TITLES.items()]):
            entries.append(None)
            entries += [MenuEntry(tr_text(title), partial(self._choose_look, look), checked=False) for look, title in looks]
        self._actions = add_menu(window, tr("&Twin"), entries)
        names = [look for look, _title in (*usual, *RARE_TITLES.items())]
        self._looks = dict(zip(names, self._actions[-len(names) :], strict=True))
        group = QActionGroup(self)
        group.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)  # an unknown look has no mark
        for action in self._looks.values():
            group.addAction(action)
        menu = next(one for one in self._actions[0].associatedObjects() if isinstance(one, QMenu))
        menu.aboutToShow.connect(self.update_entries)
        rare = QMenu(tr("Rarer loo&ks"), menu)  # on a small screen one menu would be higher than it
        for look in RARE_TITLES:
            menu.removeAction(self._looks[look])
            rare.addAction(self._looks[look])
        menu.addMenu(rare)
        self._picker.chosen.connect(self._choose_phantom)
        self.update_entries()

    @property
    def _twin(self) -> TwinConfig:
        return self._rig.config.twin

    @property
    def _is_open(self) -> bool:
        return kind_of(self._rig.config.rig) is RigKind.SIM

    def update_entries(self) -> None:
        """Mark the look in use; nothing can be chosen while another rig is open."""
        for action in self._actions:
            action.setEnabled(self._is_open)
        self._looks[OWN_LOOK].setEnabled(self._is_open and own_file(self._twin.phantom) is not None)
        current = look_of(self._twin)
        for look, action in self._looks.items():
            action.setChecked(look == current)

    def vary(self) -> None:
        """Another picture of this look. The clear bench has only one: any of the ten families, then."""
        if self._is_open:
            look = look_of(self._twin)
            self._use_look(None if look == BENCH_LOOK else look, self._twin.appearance_seed % _SEED_MAX + 1)

    def _choose_look(self, look: str | None) -> None:
        if self._is_open:
            self._use_look(look, self._twin.appearance_seed or 1)
        self.update_entries()

    def _use_look(self, look: str | None, seed: int) -> None:
        if why := self._rig.work_in_progress():
            self._say(tr("The look stays as it is: {why}", why=why), True)
            return
        self._use({"look": look, "appearance_seed": seed})
        title = tr_text(LOOK_TITLES[family_of(seed)]) if look is None else plain(self._looks[look].text())
        self._say(tr("Look: {title}", title=title), False)

    def _choose_phantom(self, name: str) -> None:
        if why := self._rig.work_in_progress():
            self._say(tr("The phantom stays as it is: {why}", why=why), True)
            self._picker.show_name(self._twin.phantom)
        else:
            self._use({"phantom": name})

    def _use(self, change: dict[str, Any]) -> None:
        config = self._rig.config
        settings = layout_settings()
        for name, value in change.items():
            settings.setValue(f"{_KEPT}/{name}", "" if value is None else value)
        self._live.setFocus()
        self._rig.use_config(config.model_copy(update={"twin": config.twin.model_copy(update=change)}))

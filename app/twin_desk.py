"""What the bench twin shows: the operator chooses its phantom and its look, and the twin is opened again with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Slot

from app.language import tr
from app.look_menu import LookMenu
from hardware.rig import RigKind, kind_of

if TYPE_CHECKING:
    from app.operator_window import OperatorWindow
    from app.widgets.phantom_picker import PhantomPicker


class TwinDesk(QObject):
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

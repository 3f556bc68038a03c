"""The menus of the operator window: everything that it can do, with its key."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from app.language import tr
from app.menus import MenuEntry, add_help_menu, add_menu
from app.next_step import Step
from app.scene_view_menu import add_scene_view_menu

if TYPE_CHECKING:
    from app.operator_window import OperatorWindow


def add_operator_menus(window: OperatorWindow) -> None:
    """Fill the window's menu bar."""
    panels, recorder = window.panels, window.recorder
    window.add_file_menu(
        [
            MenuEntry(tr("&Snapshot"), window.take_snapshot, ("P", "Ctrl+S", "Shift+P")),
            MenuEntry(tr("&Open pictures folder"), window.open_pictures),
            None,
            MenuEntry(tr("&Record, or end the recording"), recorder.toggle, ("F9", "Shift+F9")),
            MenuEntry(tr("Save the &last seconds"), recorder.save_last, ("F10", "Shift+F10")),
            MenuEntry(tr("&Mark this moment"), recorder.mark, ("M", "Shift+M")),
        ]
    )
    add_scene_view_menu(window, panels)
    add_menu(
        window,
        tr("&Robot"),
        [
            MenuEntry(tr("S&TOP"), window.desk.stop, hint="Space, Pause"),
            None,
            *(MenuEntry(tr(step.value.name), partial(window.take, step), _keys_of(step)) for step in Step),
            None,
            MenuEntry(tr("&Clear destination"), window.clear_target, hint="Esc"),
            None,
            MenuEntry(tr("Start the &rig again"), window.ask_restart, ("F5",)),
        ],
    )
    add_help_menu(window, panels.help.toggle, [MenuEntry(tr("&Tour"), window.show_tour)])


def _keys_of(step: Step) -> tuple[str, ...]:
    """The step's key, which must also be heard while Shift is held as the deadman."""
    key = step.value.key
    return (key,) if "+" in key or step is Step.ARM else (key, f"Shift+{key}")

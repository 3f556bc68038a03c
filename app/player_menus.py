"""The menus of the player: everything that it can do, with its key."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from app.language import tr
from app.menus import MenuEntry, add_help_menu, add_menu
from app.scene_view_menu import add_scene_view_menu
from app.session_marks import JumpKind

if TYPE_CHECKING:
    from app.player_window import PlayerWindow

_ZOOM = 1.5


def add_player_menus(window: PlayerWindow) -> None:
    """Fill the window's menu bar. Keys that step repeat while they are held."""
    panels = window.panels
    window.add_file_menu(
        [
            MenuEntry(tr("&Snapshot"), window.take_snapshot, ("S", "Ctrl+S")),
            None,
            MenuEntry(tr("Selection as &video"), window.export_clip, ("E",)),
            MenuEntry(tr("&Note"), window.begin_note, ("M",)),
        ]
    )
    view = add_scene_view_menu(
        window,
        panels,
        [
            MenuEntry(tr("Zoom the timeline &in"), partial(panels.timeline.zoom, _ZOOM), ("+", "=")),
            MenuEntry(tr("Zoom the timeline &out"), partial(panels.timeline.zoom, 1 / _ZOOM), ("-",)),
            MenuEntry(tr("The whole &session"), panels.timeline.fit, ("Ctrl+0",)),
        ],
    )
    play = add_menu(
        window,
        tr("&Play"),
        [
            MenuEntry(tr("&Play or pause"), window.toggle_play, ("Space",)),
            None,
            MenuEntry(tr("One frame back"), partial(window.step, -1), ("Left",)),
            MenuEntry(tr("One frame on"), partial(window.step, 1), ("Right",)),
            MenuEntry(tr("One second back"), partial(window.skip, -1.0), ("Shift+Left",)),
            MenuEntry(tr("One second on"), partial(window.skip, 1.0), ("Shift+Right",)),
            MenuEntry(tr("Ten seconds back"), partial(window.skip, -10.0), ("Ctrl+Left",)),
            MenuEntry(tr("Ten seconds on"), partial(window.skip, 10.0), ("Ctrl+Right",)),
            MenuEntry(tr("First frame"), partial(window.seek, 0.0), ("Home",)),
            MenuEntry(tr("Last frame"), partial(window.seek, float("inf")), ("End",)),
            MenuEntry(tr("Go to a &time"), window.go_to_time, ("T",)),
            None,
            MenuEntry(tr("Slower"), partial(window.faster, -1), ("[",)),
            MenuEntry(tr("Faster"), partial(window.faster, 1), ("]",)),
            MenuEntry(tr("As &recorded"), partial(window.set_speed, 1.0), ("R",)),
        ],
    )
    kinds = [
        MenuEntry(tr("Jump to: {kind}", kind=tr(kind.value).lower()), partial(window.set_jump_kind, kind)) for kind in JumpKind
    ]
    go = add_menu(
        window,
        tr("&Go"),
        [
            MenuEntry(tr("&Next"), partial(window.jump, 1), ("N",)),
            MenuEntry(tr("&Previous"), partial(window.jump, -1), ("P",)),
            MenuEntry(tr("Another &kind"), window.next_jump_kind, ("K",)),
            None,
            *kinds,
            None,
            MenuEntry(tr("&Events"), window.show_events, ("F6",)),
            None,
            MenuEntry(tr("Selection &from here"), window.select_from_here, ("I",)),
            MenuEntry(tr("Selection &to here"), window.select_to_here, ("O",)),
            MenuEntry(tr("No selection"), partial(window.select, None), hint="Esc"),
        ],
    )
    for action in (*play[1:7], *go[:2], *view[-6:-4]):
        action.setAutoRepeat(True)
    add_help_menu(window, panels.help.toggle)

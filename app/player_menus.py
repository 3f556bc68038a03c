"""The menus of the player: everything that it can do, with its key."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtGui import QAction

from app.menus import MenuEntry, add_help_menu, add_menu, turn_page
from app.session_marks import JumpKind
from app.widgets.overlays import Layer

if TYPE_CHECKING:
    from app.player_window import PlayerWindow

_ZOOM = 1.5


def add_player_menus(window: PlayerWindow) -> dict[Layer, QAction]:
    """Fill the window's menu bar; returns the actions of the overlays. Keys that step repeat while they are held."""
    panels = window.panels
    add_menu(
        window,
        "&File",
        [
            MenuEntry("&Snapshot", window.take_snapshot, ("S", "Ctrl+S")),
            None,
            MenuEntry("Selection as &video", window.export_clip, ("E",)),
            MenuEntry("&Note", window.begin_note, ("M",)),
            None,
            MenuEntry("&Quit", window.close, ("Ctrl+Q",)),
        ],
    )
    layers = [MenuEntry(la.value.label, partial(panels.overlay_bar.toggle, la), (la.value.key,), checked=True) for la in Layer]
    view = add_menu(
        window,
        "&View",
        [
            *layers,
            MenuEntry("&All overlays on or off", window.toggle_all_layers, ("0",)),
            None,
            MenuEntry("&Whole picture", panels.fit, ("F",)),
            MenuEntry("Zoom the timeline &in", partial(panels.timeline.zoom, _ZOOM), ("+", "=")),
            MenuEntry("Zoom the timeline &out", partial(panels.timeline.zoom, 1 / _ZOOM), ("-",)),
            MenuEntry("The whole &session", panels.timeline.fit, ("Ctrl+0",)),
            None,
            MenuEntry("&Next page", partial(turn_page, panels.pages, 1), ("Ctrl+Tab",)),
            MenuEntry("&Previous page", partial(turn_page, panels.pages, -1), ("Ctrl+Shift+Tab",)),
            None,
            MenuEntry("&Full screen", window.toggle_full_screen, ("F11",), checked=False),
        ],
    )
    play = add_menu(
        window,
        "&Play",
        [
            MenuEntry("&Play or pause", window.toggle_play, ("Space",)),
            None,
            MenuEntry("One frame back", partial(window.step, -1), ("Left",)),
            MenuEntry("One frame on", partial(window.step, 1), ("Right",)),
            MenuEntry("One second back", partial(window.skip, -1.0), ("Shift+Left",)),
            MenuEntry("One second on", partial(window.skip, 1.0), ("Shift+Right",)),
            MenuEntry("Ten seconds back", partial(window.skip, -10.0), ("Ctrl+Left",)),
            MenuEntry("Ten seconds on", partial(window.skip, 10.0), ("Ctrl+Right",)),
            MenuEntry("First frame", partial(window.seek, 0.0), ("Home",)),
            MenuEntry("Last frame", partial(window.seek, float("inf")), ("End",)),
            MenuEntry("Go to a &time", window.go_to_time, ("T",)),
            None,
            MenuEntry("Slower", partial(window.faster, -1), ("[",)),
            MenuEntry("Faster", partial(window.faster, 1), ("]",)),
            MenuEntry("As &recorded", partial(window.set_speed, 1.0), ("R",)),
        ],
    )
    kinds = [MenuEntry(f"Jump to: {kind.value.lower()}", partial(window.set_jump_kind, kind)) for kind in JumpKind]
    go = add_menu(
        window,
        "&Go",
        [
            MenuEntry("&Next", partial(window.jump, 1), ("N",)),
            MenuEntry("&Previous", partial(window.jump, -1), ("P",)),
            MenuEntry("Another &kind", window.next_jump_kind, ("K",)),
            None,
            *kinds,
            None,
            MenuEntry("&Events", window.show_events, ("F6",)),
            None,
            MenuEntry("Selection &from here", window.select_from_here, ("I",)),
            MenuEntry("Selection &to here", window.select_to_here, ("O",)),
            MenuEntry("No selection", partial(window.select, None), hint="Esc"),
        ],
    )
    for action in (*play[1:7], *go[:2], *view[-6:-4]):
        action.setAutoRepeat(True)
    add_help_menu(window, panels.help.toggle)
    return dict(zip(Layer, view[: len(Layer)], strict=True))

"""The menus of the annotator window: everything that it can do, with its key."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from app.annotation_tool import Tool
from app.language import tr
from app.menus import MenuEntry, add_help_menu, add_menu
from core.types import PoseState

if TYPE_CHECKING:
    from app.annotator_window import AnnotatorWindow

_ZOOM_STEP = 1.3
_BRUSH_STEP = 1.25


def add_annotator_menus(window: AnnotatorWindow) -> None:
    """Fill the window's menu bar; keys that step repeat while they are held."""
    panels = window.panels
    canvas, bar, light = panels.canvas, panels.bar, panels.light
    window.add_file_menu(
        [
            MenuEntry(tr("Where is it &saved?"), window.tell_saved, ("Ctrl+S",)),
            None,
            MenuEntry(tr("&Train on my annotations..."), window.train),
        ]
    )
    view = window.add_view_menu(
        [
            MenuEntry(tr("Zoom &in"), partial(canvas.zoom, _ZOOM_STEP), ("+", "=")),
            MenuEntry(tr("Zoom &out"), partial(canvas.zoom, 1 / _ZOOM_STEP), ("-",)),
            MenuEntry(tr("&Close-up of the head"), canvas.close_up, ("Z",)),
            MenuEntry(tr("&Whole picture"), canvas.fit, ("F", "0")),
            None,
            MenuEntry(tr("More contrast"), partial(light.step, 1), (".",)),
            MenuEntry(tr("Less contrast"), partial(light.step, -1), (",",)),
            MenuEntry(tr("Brighter"), partial(light.step, 0, 1), (">",)),
            MenuEntry(tr("Darker"), partial(light.step, 0, -1), ("<",)),
            MenuEntry(tr("Picture as it is"), light.reset, ("/",)),
            None,
            MenuEntry(tr("&Loupe"), partial(bar.toggle, "L"), ("L",)),
            MenuEntry(tr("&Masks"), partial(bar.toggle, "K"), ("K",)),
            MenuEntry(tr("&Algorithm"), window.toggle_proposal, ("H",)),
        ]
    )
    states = [MenuEntry(tr("State {state}", state=s.value), partial(window.set_state, s), (s.value,)) for s in PoseState]
    edits = add_menu(
        window,
        tr("&Edit"),
        [
            MenuEntry(tr("&Undo"), window.undo, ("Ctrl+Z",)),
            MenuEntry(tr("&Redo"), window.redo, ("Ctrl+Shift+Z", "Ctrl+Y")),
            None,
            *states,
            MenuEntry(tr("Can't tell"), window.toggle_cannot_tell, ("X",)),
            MenuEntry(tr("&Note"), window.edit_note, ("F2",)),
            None,
            MenuEntry(tr("Take the &algorithm's"), window.take_proposal, ("G",)),
            MenuEntry(tr("&Simplify outlines"), window.simplify, ("S",)),
        ],
    )
    for action in edits[:2]:
        action.setAutoRepeat(True)
    tools = [MenuEntry(tr(t.value.label), partial(window.take_tool, t), (t.value.key,)) for t in Tool]
    add_menu(
        window,
        tr("&Tools"),
        [
            *tools,
            None,
            MenuEntry(tr("&Brush"), partial(bar.toggle, "T"), ("T",)),
            MenuEntry(tr("Brush smaller"), partial(canvas.resize_brush, 1 / _BRUSH_STEP), ("[",)),
            MenuEntry(tr("Brush larger"), partial(canvas.resize_brush, _BRUSH_STEP), ("]",)),
        ],
    )
    go = add_menu(
        window,
        tr("&Go"),
        [
            MenuEntry(tr("&Next"), partial(window.step, 1), ("N", "PgDown")),
            MenuEntry(tr("&Previous"), partial(window.step, -1), ("P", "PgUp")),
            MenuEntry(tr("Next &without an answer"), window.go_open, ("U",)),
            MenuEntry(tr("&First"), partial(window.open, 0), ("Home",)),
            MenuEntry(tr("&Last"), partial(window.open, len(window.desk.items) - 1), ("End",)),
            MenuEntry(tr("Lis&t"), panels.queue.take_focus, ("F6",)),
        ],
    )
    for action in (*go[:2], *view[:2], *view[4:8]):
        action.setAutoRepeat(True)
    add_help_menu(window, panels.help.toggle)

"""The View menu of the windows that show a scene."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from PySide6.QtGui import QAction

from app.language import tr
from app.menus import MenuEntry, turn_page
from app.scene_panels import ScenePanels
from app.widgets.overlay_bar import OverlayBar
from app.widgets.overlays import Layer
from app.window_frame import WindowFrame


def add_scene_view_menu(window: WindowFrame, panels: ScenePanels, more: Sequence[MenuEntry] = ()) -> list[QAction]:
    """Overlays, the whole picture and `more`, pages; returns the actions in this order. Those of overlays follow their switches."""
    bar = panels.overlay_bar
    layers = [MenuEntry(tr(layer.value.label), partial(bar.toggle, layer), (layer.value.key,), checked=True) for layer in Layer]
    entries = [
        *layers,
        MenuEntry(tr("&All overlays on or off"), partial(_toggle_all, bar), ("0",)),
        None,
        MenuEntry(tr("&Whole picture"), panels.fit, ("F",)),
        *more,
        None,
        MenuEntry(tr("&Next page"), partial(turn_page, panels.pages, 1), ("Ctrl+Tab",)),
        MenuEntry(tr("&Previous page"), partial(turn_page, panels.pages, -1), ("Ctrl+Shift+Tab",)),
    ]
    actions = window.add_view_menu(entries)
    of_layer = dict(zip(Layer, actions, strict=False))
    bar.toggled.connect(lambda layer, on: of_layer[layer].setChecked(on))
    return actions


def _toggle_all(bar: OverlayBar) -> None:
    bar.set_all(not any(bar.is_on(layer) for layer in Layer))

"""Keeps the layout of a window until the next run: size and place, columns, pages, switches. Broken values are ignored."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from PySide6.QtCore import QByteArray, QEvent, QObject, QSettings
from PySide6.QtWidgets import QMainWindow, QTabWidget

from app.ui import theme
from app.ui.actions import MenuEntry, add_menu
from app.ui.i18n import tr
from app.widgets.basics import Columns
from app.widgets.scene_overlay import Layer, OverlayBar

_NAME = "LumenPilot"


@dataclass(frozen=True, slots=True)
class Switch:
    """Something that is on or off."""

    is_on: Callable[[], bool]
    turn: Callable[[bool], object]


@dataclass(frozen=True, slots=True)
class Parts:
    """What is kept of a window, by names that stay the same from version to version."""

    columns: Mapping[str, Columns] = field(default_factory=dict)
    pages: Mapping[str, QTabWidget] = field(default_factory=dict)
    switches: Mapping[str, Switch] = field(default_factory=dict)


def layout_settings() -> QSettings:
    """Where layouts are kept: an INI file in the user's configuration folder."""
    return QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, _NAME, "layout")


class LayoutState(QObject):
    """Arranges the window as it was, and keeps it when it closes. "Reset layout" in the View menu puts all back.

    Parameters
    ----------
    window : as it is by default; not shown yet.
    name : of the kind of window.
    parts : what to keep beside its size and place.
    """

    def __init__(self, window: QMainWindow, name: str, parts: Parts) -> None:
        super().__init__(window)
        self._window, self._name, self._parts = window, name, parts
        self._default = self._values()
        add_menu(window, tr("&View"), [MenuEntry(tr("&Reset layout"), self.reset)])
        self._restore()
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Close and watched is self._window:
            self.save()
        return False

    def save(self) -> None:
        """Keep the present layout; a disk that refuses is ignored."""
        settings = layout_settings()
        settings.beginGroup(self._name)
        if not self._window.isFullScreen():
            settings.setValue("geometry", self._window.saveGeometry())
        for key, value in self._values().items():
            settings.setValue(key, value)
        settings.endGroup()
        settings.sync()

    def reset(self) -> None:
        """The default layout, now and at the next start."""
        settings = layout_settings()
        settings.remove(self._name)
        settings.sync()
        window = self._window
        if not window.isFullScreen():
            window.showNormal()
            window.resize(theme.start_size(window.screen()))
            room = window.screen().availableGeometry()
            window.move(room.center() - window.rect().center())
        self._arrange(self._default)

    def _restore(self) -> None:
        settings = layout_settings()
        settings.beginGroup(self._name)
        geometry = settings.value("geometry")
        if isinstance(geometry, QByteArray) and geometry.size() and self._window.restoreGeometry(geometry):
            room = self._window.screen().availableGeometry().size()
            self._window.resize(self._window.size().boundedTo(room).expandedTo(self._window.minimumSize()))
        self._arrange({key: settings.value(key) for key in self._default if settings.contains(key)})
        settings.endGroup()

    def _values(self) -> dict[str, object]:
        parts = self._parts
        return {
            **{f"columns/{name}": columns.share for name, columns in parts.columns.items()},
            **{f"page/{name}": _page_name(pages, pages.currentIndex()) for name, pages in parts.pages.items()},
            **{f"switch/{name}": switch.is_on() for name, switch in parts.switches.items()},
        }

    def _arrange(self, values: Mapping[str, object]) -> None:
        """Apply the values that are known and valid."""
        parts = self._parts
        for name, columns in parts.columns.items():
            with contextlib.suppress(ValueError):  # an INI file holds texts
                share = float(str(values.get(f"columns/{name}")))
                if 0.0 < share < 1.0:
                    columns.set_share(share)
        for name, pages in parts.pages.items():
            names = [_page_name(pages, place) for place in range(pages.count())]
            wanted = values.get(f"page/{name}")
            if wanted in names:
                pages.setCurrentIndex(names.index(str(wanted)))
        for name, switch in parts.switches.items():
            on = {"true": True, "false": False}.get(str(values.get(f"switch/{name}")).lower())
            if on is not None and on is not switch.is_on():
                switch.turn(on)


def _page_name(pages: QTabWidget, place: int) -> str:
    """A page's own name: its title may count something."""
    page = pages.widget(place)
    return (page.accessibleName() if page is not None else "") or pages.tabText(place)


def overlay_switches(bar: OverlayBar, without: tuple[Layer, ...] = ()) -> dict[str, Switch]:
    """The switches of the overlays, without those that are not the user's choice."""
    layers = [layer for layer in Layer if layer not in without]
    return {layer.name.lower(): Switch(partial(bar.is_on, layer), toggling(partial(bar.toggle, layer))) for layer in layers}


def toggling(toggle: Callable[[], object]) -> Callable[[bool], object]:
    """A switch's ``turn`` that toggles: it is only called for another state."""
    return lambda _on: toggle()

"""Keeps the layout of a window until the next run: size and place, columns, pages, switches. Broken values are ignored."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

from PySide6.QtCore import QByteArray, QEvent, QObject, QSettings
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMainWindow, QTabWidget

from app.ui import theme
from app.ui.actions import MenuEntry, add_menu
from app.ui.i18n import tr
from app.widgets.basics import Columns

_NAME = "LumenPilot"
_COLUMNS, _PAGE = "columns/main", "page/right"


def layout_settings() -> QSettings:
    """Where layouts are kept: an INI file in the user's configuration folder."""
    return QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, _NAME, "layout")


class LayoutState(QObject):
    """Arranges the window as it was, and keeps it when it closes. "Reset layout" in the View menu puts all back.

    Parameters
    ----------
    window : as it is by default; not shown yet.
    name : of the kind of window.
    switches : checkable actions, by names that stay the same from version to version.
    """

    def __init__(
        self,
        window: QMainWindow,
        name: str,
        columns: Columns,
        pages: QTabWidget | None = None,
        switches: Mapping[str, QAction] | None = None,
    ) -> None:
        super().__init__(window)
        self._window, self._name = window, name
        self._columns, self._pages, self._switches = columns, pages, switches or {}
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
        pages = self._pages
        return {
            _COLUMNS: self._columns.share,
            **({_PAGE: _page_name(pages, pages.currentIndex())} if pages is not None else {}),
            **{f"switch/{name}": action.isChecked() for name, action in self._switches.items()},
        }

    def _arrange(self, values: Mapping[str, object]) -> None:
        """Apply the values that are known and valid."""
        with contextlib.suppress(ValueError):  # an INI file holds texts
            share = float(str(values.get(_COLUMNS)))
            if 0.0 < share < 1.0:
                self._columns.set_share(share)
        if (pages := self._pages) is not None:
            names = [_page_name(pages, place) for place in range(pages.count())]
            if (wanted := values.get(_PAGE)) in names:
                pages.setCurrentIndex(names.index(str(wanted)))
        for name, action in self._switches.items():
            on = {"true": True, "false": False}.get(str(values.get(f"switch/{name}")).lower())
            if on is not None and on is not action.isChecked():
                action.trigger()


def _page_name(pages: QTabWidget, place: int) -> str:
    """A page's own name: its title may count something."""
    page = pages.widget(place)
    return (page.accessibleName() if page is not None else "") or pages.tabText(place)

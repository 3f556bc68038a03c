"""How panels stand in a window: below each other, side by side, and in two columns."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QLabel, QLayout, QTabWidget, QVBoxLayout, QWidget

from app import theme
from app.language import tr

_TOP_PX = 4


def column(*parts: tuple[QWidget, int], spacing: int = theme.GAP) -> QVBoxLayout:
    """Widgets below each other, each with its stretch."""
    layout = QVBoxLayout()
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(spacing)
    for widget, stretch in parts:
        layout.addWidget(widget, stretch)
    return layout


def row(*widgets: QWidget) -> QWidget:
    """Widgets side by side, equally wide."""
    layout = QHBoxLayout()
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(theme.GAP)
    for widget in widgets:
        layout.addWidget(widget, 1)
    return holder(layout)


def holder(layout: QLayout) -> QWidget:
    """A widget that is nothing but the place of a layout."""
    widget = QWidget()
    widget.setLayout(layout)
    return widget


def side(layout: QLayout, narrowest: int, widest: int) -> QWidget:
    """The right one of two columns: beyond a width its dials gain nothing, and the picture everything. Pixels."""
    widget = holder(layout)
    widget.setMinimumWidth(narrowest)
    widget.setMaximumWidth(widest)
    return widget


def set_window_margins(layout: QLayout) -> None:
    """Those of the panels to the window's edges."""
    layout.setContentsMargins(theme.GAP, _TOP_PX, theme.GAP, theme.GAP)


def card_note(text: str) -> QLabel:
    """The small text at the right of a card's title, for who changes it later."""
    label = QLabel(text)
    label.setObjectName("card_note")
    return label


def page_tabs() -> QTabWidget:
    """Pages that share a place."""
    pages = QTabWidget()
    pages.setDocumentMode(True)
    pages.setAccessibleName(tr("Pages"))
    pages.tabBar().setAccessibleName(tr("Pages"))
    pages.tabBar().setDrawBase(False)
    return pages

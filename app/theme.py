"""Sizes, fonts and style sheet of every window; the colours are in ``palette``."""

from __future__ import annotations

from enum import StrEnum
from functools import cache

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontDatabase, QFontMetrics, QPalette, QScreen
from PySide6.QtWidgets import QApplication

from app.palette import INK, LINE, PANEL, RAISED, SKY, TEXT, TEXT_DIM, TEXT_FAINT, WINDOW
from core.config import RESOURCES

MIN_WINDOW = (1100, 660)  # fits a screen of 720 lines with title bar and task bar
START_WINDOW = (1600, 900)
_FRAME = (8, 40)  # room for the title bar and borders that the desktop adds
GAP = 10
RADIUS = 8


class Size(StrEnum):
    """Names of the text sizes; pixels in ``_PIXELS``."""

    LABEL = "label"
    BODY = "body"
    TITLE = "title"
    NUMBER = "number"


_PIXELS = {Size.LABEL: 12, Size.BODY: 14, Size.TITLE: 27, Size.NUMBER: 32}
_FAMILIES = ["Inter", "Segoe UI", "Noto Sans", "DejaVu Sans", "sans-serif"]


def colour(name: str, alpha: float = 1.0) -> QColor:
    """The colour `name` with opacity 0..1."""
    result = QColor(name)
    result.setAlphaF(alpha)
    return result


@cache
def font(size: Size | int = Size.BODY, weight: QFont.Weight = QFont.Weight.Normal) -> QFont:
    """The interface font with digits of equal width, so that nothing moves when a number changes. Copy it before you change it."""
    result = QFont()
    result.setFamilies(_FAMILIES)
    result.setPixelSize(size if isinstance(size, int) else _PIXELS[size])
    result.setWeight(weight)
    result.setFeature(QFont.Tag("tnum"), 1)
    return result


def bold(size: Size | int = Size.BODY) -> QFont:
    return font(size, QFont.Weight.Bold)


def semi_bold(size: Size | int = Size.BODY) -> QFont:
    return font(size, QFont.Weight.DemiBold)


def fitted(text_font: QFont, text: str, width_px: int, smallest_px: int = 11) -> QFont:
    """`text_font`, made smaller until `text` fits into `width_px` (not below `smallest_px`)."""
    result = QFont(text_font)
    while result.pixelSize() > smallest_px and QFontMetrics(result).horizontalAdvance(text) > width_px:
        result.setPixelSize(result.pixelSize() - 1)
    return result


def start_size(screen: QScreen) -> QSize:
    """The size of a window that opens on `screen`: the usual one, or what there is room for."""
    room = screen.availableGeometry().size() - QSize(*_FRAME)
    return QSize(*START_WINDOW).boundedTo(room).expandedTo(QSize(*MIN_WINDOW))


def apply_theme(application: QApplication) -> None:
    """Style, palette, fonts and style sheet for the whole program. Without the font files the system's sans serif is used."""
    for path in sorted((RESOURCES / "fonts").glob("*.otf")):
        QFontDatabase.addApplicationFont(str(path))
    application.setStyle("Fusion")
    application.setPalette(_palette())
    application.setFont(font(Size.BODY))
    application.setStyleSheet(_STYLE_SHEET)


def _palette() -> QPalette:
    palette = QPalette()
    roles = QPalette.ColorRole
    for role, name in (
        (roles.Window, WINDOW),
        (roles.WindowText, TEXT),
        (roles.Base, PANEL),
        (roles.AlternateBase, RAISED),
        (roles.Text, TEXT),
        (roles.PlaceholderText, TEXT_FAINT),
        (roles.Button, RAISED),
        (roles.ButtonText, TEXT),
        (roles.BrightText, TEXT),
        (roles.ToolTipBase, RAISED),
        (roles.ToolTipText, TEXT),
        (roles.Highlight, SKY),
        (roles.HighlightedText, INK),
        (roles.Link, SKY),
    ):
        palette.setColor(role, QColor(name))
    for role in (roles.WindowText, roles.Text, roles.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(TEXT_FAINT))
    return palette


def elide(text_font: QFont, text: str, width_px: int) -> str:
    """`text`, cut with an ellipsis where it does not fit into `width_px`."""
    return QFontMetrics(text_font).elidedText(text, Qt.TextElideMode.ElideRight, width_px)


_STYLE_SHEET = f"""
QMainWindow, QDialog {{ background: {WINDOW}; }}
QFrame#card {{ background: {PANEL}; border: 1px solid {LINE}; border-radius: {RADIUS}px; }}
QLabel#card_title {{ color: {TEXT_DIM}; font-size: 12px; font-weight: 600; }}
QLabel#card_note {{ color: {TEXT_FAINT}; font-size: 12px; }}
QMenuBar {{ background: {WINDOW}; color: {TEXT_DIM}; padding: 2px 6px; }}
QMenuBar::item {{ padding: 4px 10px; border-radius: 4px; background: transparent; }}
QMenuBar::item:selected {{ background: {RAISED}; color: {TEXT}; }}
QMenu {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; padding: 4px; }}
QMenu::item {{ padding: 6px 28px 6px 22px; border-radius: 4px; }}
QMenu::item:selected {{ background: {SKY}; color: {INK}; }}
QMenu::item:disabled {{ color: {TEXT_FAINT}; }}
QMenu::separator {{ height: 1px; background: {LINE}; margin: 4px 8px; }}
QStatusBar {{ background: {WINDOW}; color: {TEXT_DIM}; font-size: 13px; }}
QStatusBar::item {{ border: none; }}
QToolTip {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; padding: 6px; }}
QComboBox, QSpinBox {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; border-radius: 5px; padding: 3px 8px;
    min-height: 22px; selection-background-color: {SKY}; selection-color: {INK}; }}
QComboBox:focus, QSpinBox:focus, QPushButton:focus {{ border: 1px solid {SKY}; }}
QComboBox::drop-down {{ border: none; width: 24px; }}
QComboBox::down-arrow {{ width: 0; height: 0; border-left: 4px solid {RAISED}; border-right: 4px solid {RAISED};
    border-top: 5px solid {TEXT_DIM}; margin-right: 10px; }}
QComboBox QAbstractItemView {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE};
    selection-background-color: {SKY}; selection-color: {INK}; outline: none; }}
QPushButton {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; border-radius: 5px;
    padding: 4px 12px; min-height: 22px; }}
QTabWidget::pane {{ border: none; }}
QTabBar {{ background: transparent; }}
QTabBar::tab {{ background: {WINDOW}; color: {TEXT_DIM}; border: 1px solid {LINE}; border-bottom: none;
    border-top-left-radius: 5px; border-top-right-radius: 5px; padding: 4px 12px; margin-right: 3px; }}
QTabBar::tab:selected {{ background: {RAISED}; color: {TEXT}; border-color: {TEXT_FAINT}; }}
QTabBar::tab:hover {{ color: {TEXT}; }}
QPushButton:hover {{ border-color: {TEXT_FAINT}; }}
QPushButton:pressed {{ background: {LINE}; }}
QPushButton:disabled, QSpinBox:disabled {{ color: {TEXT_FAINT}; background: {WINDOW}; }}
"""

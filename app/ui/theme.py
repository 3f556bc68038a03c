"""Colours, sizes, fonts and style sheet of every window, in the two schemes of ``app.ui.palette``.

Module attributes such as ``theme.TEXT`` are those of the scheme in use: read them when painting, or keep a role's name and call
``of``. What is drawn over a camera picture has the colours ``ON_PICTURE`` in both schemes. A change of scheme reaches everything
that is open: style sheets set by ``set_sheet`` are set again, and widgets that keep something made of colours (a pixmap, a plot's
pens, rich text) have a method ``follow_theme``.
"""

from __future__ import annotations

import re
from dataclasses import asdict, fields
from enum import StrEnum
from functools import cache

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontDatabase, QFontMetrics, QPalette, QPen, QScreen
from PySide6.QtWidgets import QApplication, QWidget

from app.ui import palette
from app.ui.palette import DARK, LIGHT, Scheme
from core.config.models import RESOURCES

ON_PICTURE, STATE_INK, STATE_COLOUR = palette.ON_PICTURE, palette.STATE_INK, palette.STATE_COLOUR
rgb, contrast = palette.rgb, palette.contrast

# The colours of the scheme in use; ``use_scheme`` sets them all.
WINDOW = PANEL = RAISED = LINE = TEXT = TEXT_DIM = TEXT_FAINT = INK = FAULT = ""
ORANGE = SKY = GREEN = YELLOW = VERMILLION = PURPLE = SIM = LIVE = PLAYBACK = ""
VESSEL = ROBOT = ROBOT_VECTOR = VESSEL_VECTOR = HEAD = NEAREST = THETA = D_HEAD = D_TAIL = ROUTE = GHOST = TARGET = ALLOWED = ""

_ROLES = frozenset(field.name for field in fields(Scheme))
_current = DARK


def use_scheme(scheme: Scheme) -> None:
    """Set the colours of all windows; ``apply_theme`` calls it, and has everything painted again."""
    global _current  # noqa: PLW0603 - there is one screen, and one scheme for it
    _current = scheme
    globals().update(asdict(scheme))
    STATE_COLOUR[None] = scheme.TEXT_FAINT


use_scheme(DARK)


def current() -> Scheme:
    return _current


def of(role: str) -> str:
    """The colour of a role (``"SKY"``) in the scheme in use; a colour ("#12AB00") is itself."""
    return str(getattr(_current, role)) if role in _ROLES else role


def sheet(text: str) -> str:
    """A style sheet in which ``@TEXT`` stands for the colour of that role."""
    return re.sub(r"@([A-Z_]+)", lambda found: of(found[1]), text)


MIN_WINDOW = (1100, 660)  # fits a screen of 720 lines with title bar and task bar
MIN_WIDE_PX = 1272  # of windows with one long row of controls: fits a screen of 1280 columns
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
_SEEN = 3.0
"""Contrast from which on a plain shape is seen (WCAG 2.1)."""
_CHOSEN = "lumenpilot_theme"
_SHEET = "lumenpilot_sheet"
_FAMILIES = ["Inter", "Segoe UI", "Noto Sans", "DejaVu Sans"]
_CHINESE_FAMILIES = ["Noto Sans CJK SC", "Source Han Sans SC", "Microsoft YaHei", "PingFang SC", "WenQuanYi Micro Hei"]
"""For letters that the others do not have; without a name the system may take Japanese shapes of them."""


def colour(name: str, alpha: float = 1.0) -> QColor:
    """The colour `name` with opacity 0..1."""
    result = QColor(name)
    result.setAlphaF(alpha)
    return result


def edge_of(name: str) -> QPen:
    """The outline of something filled with a colour on a panel: none, unless it would be lost there (yellow on white)."""
    if contrast(name, PANEL) >= _SEEN:
        return QPen(Qt.PenStyle.NoPen)
    return QPen(QColor(TEXT_DIM), 1.5)


def outline_of(name: str, width_px: float) -> QPen:
    """The pen of a shape on a panel that is not filled; grey where the colour would be lost there."""
    return QPen(QColor(name if contrast(name, PANEL) >= _SEEN else TEXT_DIM), width_px)


@cache
def font(size: Size | int = Size.BODY, weight: QFont.Weight = QFont.Weight.Normal) -> QFont:
    """The interface font with digits of equal width, so that nothing moves when a number changes. Copy it before you change it."""
    result = QFont()
    result.setFamilies([*_FAMILIES, *_CHINESE_FAMILIES, "sans-serif"])
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


class Theme(StrEnum):
    """What can be chosen; SYSTEM is as the desktop has it."""

    DARK = "dark"
    LIGHT = "light"
    SYSTEM = "system"


def apply_theme(application: QApplication, theme: str = Theme.DARK) -> None:
    """Style, palette, fonts and style sheet for the whole program, now and, with SYSTEM, whenever the desktop changes.

    Without the font files the system's sans serif is used.
    """
    hints = application.styleHints()
    if application.property(_CHOSEN) is None:
        for path in sorted((RESOURCES / "fonts").glob("*.otf")):
            QFontDatabase.addApplicationFont(str(path))
        application.setStyle("Fusion")
        application.setFont(font(Size.BODY))
        hints.colorSchemeChanged.connect(lambda _scheme: _follow_desktop(application))
    application.setProperty(_CHOSEN, str(theme))
    _apply_scheme(application, _scheme_of(Theme(theme), hints.colorScheme()))


def chosen(application: QApplication) -> str:
    """The theme that was asked for last."""
    return str(application.property(_CHOSEN) or Theme.DARK)


def set_sheet(widget: QWidget, text: str) -> None:
    """A style sheet of one widget that follows the scheme: ``@TEXT`` stands for the colour of that role."""
    widget.setProperty(_SHEET, text)
    widget.setStyleSheet(sheet(text))


def _scheme_of(theme: Theme, desktop: Qt.ColorScheme) -> Scheme:
    is_light = theme is Theme.LIGHT or (theme is Theme.SYSTEM and desktop is Qt.ColorScheme.Light)
    return LIGHT if is_light else DARK


def _follow_desktop(application: QApplication) -> None:
    if application.property(_CHOSEN) == Theme.SYSTEM:
        _apply_scheme(application, _scheme_of(Theme.SYSTEM, application.styleHints().colorScheme()))


def _apply_scheme(application: QApplication, scheme: Scheme) -> None:
    use_scheme(scheme)
    application.setPalette(_palette())
    application.setStyleSheet(sheet(_STYLE_SHEET))
    for widget in application.allWidgets():
        text = widget.property(_SHEET)
        if isinstance(text, str):
            widget.setStyleSheet(sheet(text))
        follow = getattr(widget, "follow_theme", None)
        if follow is not None:
            follow()
        QWidget.update(widget)  # item views have another one of their own


def _palette() -> QPalette:
    colours = QPalette()
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
        colours.setColor(role, QColor(name))
    for role in (roles.WindowText, roles.Text, roles.ButtonText):
        colours.setColor(QPalette.ColorGroup.Disabled, role, QColor(TEXT_FAINT))
    return colours


def elide(text_font: QFont, text: str, width_px: int) -> str:
    """`text`, cut with an ellipsis where it does not fit into `width_px`."""
    return QFontMetrics(text_font).elidedText(text, Qt.TextElideMode.ElideRight, width_px)


_STYLE_SHEET = """
QMainWindow, QDialog { background: @WINDOW; }
QFrame#card { background: @PANEL; border: 1px solid @LINE; border-radius: 8px; }
QLabel#card_title { color: @TEXT_DIM; font-size: 12px; font-weight: 600; }
QLabel#card_note { color: @TEXT_FAINT; font-size: 12px; }
QMenuBar { background: @WINDOW; color: @TEXT_DIM; padding: 2px 6px; }
QMenuBar::item { padding: 4px 10px; border-radius: 4px; background: transparent; }
QMenuBar::item:selected { background: @RAISED; color: @TEXT; }
QMenu { background: @RAISED; color: @TEXT; border: 1px solid @LINE; padding: 4px; }
QMenu::item { padding: 6px 28px 6px 22px; border-radius: 4px; }
QMenu::item:selected { background: @SKY; color: @INK; }
QMenu::item:disabled { color: @TEXT_FAINT; }
QMenu::separator { height: 1px; background: @LINE; margin: 4px 8px; }
QStatusBar { background: @WINDOW; color: @TEXT_DIM; font-size: 13px; }
QStatusBar::item { border: none; }
QToolTip { background: @RAISED; color: @TEXT; border: 1px solid @LINE; padding: 6px; }
QComboBox, QSpinBox, QDoubleSpinBox { background: @RAISED; color: @TEXT; border: 1px solid @LINE; border-radius: 5px;
    padding: 3px 8px; min-height: 22px; selection-background-color: @SKY; selection-color: @INK; }
QComboBox:focus, QSpinBox:focus, QDoubleSpinBox:focus, QPushButton:focus { border: 1px solid @SKY; }
QSpinBox::up-button, QSpinBox::down-button, QDoubleSpinBox::up-button, QDoubleSpinBox::down-button { subcontrol-origin: border;
    width: 20px; border: none; background: transparent; }
QSpinBox::up-button, QDoubleSpinBox::up-button { subcontrol-position: top right; }
QSpinBox::down-button, QDoubleSpinBox::down-button { subcontrol-position: bottom right; }
QSpinBox::up-arrow, QDoubleSpinBox::up-arrow { width: 0; height: 0; border-left: 4px solid @RAISED;
    border-right: 4px solid @RAISED; border-bottom: 5px solid @TEXT_DIM; }
QSpinBox::down-arrow, QDoubleSpinBox::down-arrow { width: 0; height: 0; border-left: 4px solid @RAISED;
    border-right: 4px solid @RAISED; border-top: 5px solid @TEXT_DIM; }
QComboBox::drop-down { border: none; width: 24px; }
QComboBox::down-arrow, QPushButton::menu-indicator { width: 0; height: 0; border-left: 4px solid @RAISED;
    border-right: 4px solid @RAISED; border-top: 5px solid @TEXT_DIM; margin-right: 10px; }
QPushButton::menu-indicator { subcontrol-origin: padding; subcontrol-position: right center; right: -3px; }
QComboBox QAbstractItemView { background: @RAISED; color: @TEXT; border: 1px solid @LINE;
    selection-background-color: @SKY; selection-color: @INK; outline: none; }
QPushButton { background: @RAISED; color: @TEXT; border: 1px solid @LINE; border-radius: 5px;
    padding: 4px 12px; min-height: 22px; }
QProgressBar[textVisible="false"] { background: @LINE; border: none; border-radius: 3px; }
QProgressBar[textVisible="false"]::chunk { background: @SKY; border-radius: 3px; }
QTabWidget::pane { border: none; }
QTabBar { background: transparent; }
QTabBar::tab { background: @WINDOW; color: @TEXT_DIM; border: 1px solid @LINE; border-bottom: none;
    border-top-left-radius: 5px; border-top-right-radius: 5px; padding: 4px 12px; margin-right: 3px; }
QTabBar::tab:selected { background: @RAISED; color: @TEXT; border-color: @TEXT_FAINT; }
QTabBar::tab:hover { color: @TEXT; }
QPushButton:hover { border-color: @TEXT_FAINT; }
QPushButton:pressed { background: @LINE; }
QPushButton:disabled, QComboBox:disabled, QSpinBox:disabled, QDoubleSpinBox:disabled { color: @TEXT_FAINT; background: @WINDOW; }
QSpinBox::up-arrow:disabled, QDoubleSpinBox::up-arrow:disabled { border-left-color: @WINDOW; border-right-color: @WINDOW;
    border-bottom-color: @LINE; }
QSpinBox::down-arrow:disabled, QDoubleSpinBox::down-arrow:disabled { border-left-color: @WINDOW; border-right-color: @WINDOW;
    border-top-color: @LINE; }
QComboBox::down-arrow:disabled { border-left-color: @WINDOW; border-right-color: @WINDOW; border-top-color: @LINE; }
QPushButton#main_button:enabled { background: @SKY; color: @INK; font-weight: 600; }
QPushButton#main_button:focus { border: 2px solid @TEXT; }
QScrollBar:vertical { background: transparent; width: 10px; margin: 0; }
QScrollBar:horizontal { background: transparent; height: 10px; margin: 0; }
QScrollBar::handle:vertical { background: @LINE; border-radius: 4px; min-height: 28px; margin: 0 1px; }
QScrollBar::handle:horizontal { background: @LINE; border-radius: 4px; min-width: 28px; margin: 1px 0; }
QScrollBar::handle:hover { background: @TEXT_FAINT; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0; height: 0; }
QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }
QScrollArea#checks { background: transparent; border: 1px solid transparent; border-radius: 6px; }
QScrollArea#checks:focus { border: 1px solid @SKY; }
QSplitter::handle { background: transparent; }
QSplitter::handle:hover { background: @LINE; border-radius: 3px; }
QDialog#settings QLineEdit { background: @PANEL; color: @TEXT; border: 1px solid @LINE; border-radius: 5px; padding: 4px 8px;
    min-height: 20px; selection-background-color: @SKY; selection-color: @INK; }
QDialog#settings QLineEdit:focus { border: 1px solid @SKY; }
QDialog#settings QLineEdit:disabled { color: @TEXT_FAINT; }
QDialog#settings QLineEdit[wrong="true"] { border: 1px solid @FAULT; }
QDialog#settings QTreeWidget { background: @PANEL; color: @TEXT; border: 1px solid @LINE; border-radius: 8px; padding: 4px;
    outline: none; }
QDialog#settings QTreeWidget:focus { border: 1px solid @SKY; }
QDialog#settings QTreeWidget::item { padding: 4px 2px; }
QDialog#settings QTreeWidget::item:selected { background: @SKY; color: @INK; }
QDialog#settings QScrollArea, QWidget#setting_page { background: @WINDOW; }
QFrame#setting { background: @PANEL; border: 1px solid @LINE; border-left: 4px solid @LINE; border-radius: 8px; }
QFrame#setting[changed="true"] { border-left: 4px solid @ORANGE; }
QFrame#setting[wrong="true"] { border: 1px solid @FAULT; border-left: 4px solid @FAULT; }
QLabel#setting_name { color: @TEXT; font-size: 14px; font-weight: 600; }
QLabel#setting_meaning { color: @TEXT_DIM; font-size: 13px; }
QLabel#setting_note { color: @TEXT_FAINT; font-size: 12px; }
QLabel#setting_error { color: @FAULT; font-size: 13px; font-weight: 600; }
QLabel#section_title { color: @TEXT; font-size: 18px; font-weight: 700; padding-top: 8px; }
QFrame#setting QSlider::groove:horizontal { height: 4px; background: @LINE; border-radius: 2px; }
QFrame#setting QSlider::sub-page:horizontal { background: @SKY; border-radius: 2px; }
QFrame#setting QSlider::handle:horizontal { background: @TEXT_DIM; width: 12px; margin: -4px 0; border-radius: 6px; }
"""

FORM_SHEET = """
QPushButton:checked { background: @SKY; color: @INK; }
QLineEdit { background: @PANEL; color: @TEXT; border: 1px solid @LINE; border-radius: 5px; padding: 4px 8px;
    min-height: 20px; selection-background-color: @SKY; selection-color: @INK; }
QLineEdit:focus { border: 1px solid @SKY; }
QLineEdit:disabled { color: @TEXT_FAINT; background: @WINDOW; }
QAbstractSpinBox QLineEdit { background: transparent; border: none; padding: 0; min-height: 0; }
QListWidget, QTableWidget, QPlainTextEdit { background: @PANEL; color: @TEXT; border: 1px solid @LINE;
    border-radius: 5px; gridline-color: @LINE; selection-background-color: @SKY; selection-color: @INK; outline: none; }
QListWidget:focus, QTableWidget:focus, QPlainTextEdit:focus { border: 1px solid @SKY; }
QListWidget::item { padding: 4px 6px; }
QListWidget::item:selected { background: @SKY; color: @INK; }
QTableWidget::item { padding: 0 6px; }
QTableWidget::item:selected { background: @SKY; color: @INK; }
QTableWidget QHeaderView::section { background: @RAISED; color: @TEXT_DIM; border: none; border-bottom: 1px solid @LINE;
    padding: 4px 6px; font-size: 12px; font-weight: 600; }
"""
"""For a dialog with fields, lists and tables: by ``set_sheet`` on the dialog itself. In the application's sheet, rules that name a
dialog do not hold for a field that was measured before it came into the dialog: Qt keeps what it has found."""

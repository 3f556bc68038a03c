"""The language of the windows, by Qt's own translation: English in the code, others from ``resources/translations``.

English is the language of everything that is kept or read by programs: session files, JSON, logs, the command line. A text is
translated only where it is shown; those that come from ``core``, which knows no window, by the list in ``core_texts``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.core_texts import COMPOSED, TEMPLATES
from core.config import RESOURCES

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

CONTEXT = "LumenPilot"
"""The one context of all texts."""
FOLDER = RESOURCES / "translations"
AUTO, ENGLISH, CHINESE = "auto", "en", "zh"
"""What ``window.language`` may be."""
LOCALE = {CHINESE: "zh_CN"}
"""Languages that are translations, and how their files are called."""


@dataclass(slots=True)
class _InUse:
    """Which language the windows speak, how a text is looked up (None: English, as it stands in the code), what is missing."""

    code: str = ENGLISH
    lookup: Callable[[str], str] | None = None
    problem: str = ""


_IN_USE = _InUse()
_VALUE = re.compile(r"\{(\w+)\}")
_AS_WRITTEN: ContextVar[bool] = ContextVar("texts as written", default=False)


def mark(text: str) -> str:
    """A text in a table that is translated later, by ``tr`` where it is shown; it stays as it is."""
    return text


def tr(text: str, /, **values: object) -> str:
    """`text` in the language of the windows, with `values` in the places of its {names}."""
    shown = text if _IN_USE.lookup is None or _AS_WRITTEN.get() else _IN_USE.lookup(text)
    return shown.format(**values) if values else shown


def tr_text(text: str) -> str:
    """A finished text of a layer below: a known one, or one made by a known pattern; any other stays English."""
    if _IN_USE.lookup is None or _AS_WRITTEN.get() or not text:
        return text
    return _finished(text)


@lru_cache(maxsize=1024)
def _finished(text: str) -> str:
    whole = tr(text)
    if whole != text:
        return whole
    for template, pattern in _patterns():
        found = pattern.fullmatch(text)
        if found is not None:
            return tr(template, **{name: tr_text(part) for name, part in found.groupdict().items()})
    return text


@cache
def _patterns() -> tuple[tuple[str, re.Pattern[str]], ...]:
    """The more words of its own a template has, the earlier it is tried: a short one would fit the texts of longer ones."""
    templates = sorted((*TEMPLATES, *COMPOSED), key=lambda template: len(_VALUE.sub("", template)), reverse=True)
    return tuple((template, _pattern(template)) for template in templates)


def _pattern(template: str) -> re.Pattern[str]:
    parts = _VALUE.split(template)
    made = (re.escape(part) if k % 2 == 0 else f"(?P<{part}>{_value(part)})" for k, part in enumerate(parts))
    return re.compile("".join(made), re.DOTALL)


def _value(name: str) -> str:
    return r"[-+]?\d[\d.]*" if len(name) == 1 else ".+?"


@contextmanager
def english_texts() -> Iterator[None]:
    """In here, and in this thread only, texts are English: what is kept in a file is."""
    token = _AS_WRITTEN.set(True)
    try:
        yield
    finally:
        _AS_WRITTEN.reset(token)


def language_in_use() -> str:
    """ "en", or the translation's code."""
    return _IN_USE.code


def language_problem() -> str:
    """What ``use_language`` has said: empty, or one line about what is missing."""
    return _IN_USE.problem


def wanted(choice: str) -> str:
    """The language of a choice: the system's where it is "auto"; English where there is no such translation."""
    if choice != AUTO:
        return choice if choice in LOCALE else ENGLISH
    from PySide6.QtCore import QLocale

    names = QLocale.system().uiLanguages()
    code = names[0].replace("_", "-").partition("-")[0].lower() if names else ENGLISH
    return code if code in LOCALE else ENGLISH


def use_language(application: QApplication, choice: str = AUTO, folder: Path = FOLDER) -> str:
    """Speak this language from now on, in windows that are opened later.

    Parameters
    ----------
    application : the one there is.
    choice : "auto", "en" or "zh"; an unknown one is English.
    folder : of the translations.

    Returns
    -------
    str
        Empty, or one line about what is missing: the translation (it stays English then), or a font that has its letters.
    """
    from PySide6.QtCore import QCoreApplication, QLibraryInfo, QTranslator

    for old in application.findChildren(QTranslator):
        application.removeTranslator(old)
        old.deleteLater()
    _IN_USE.code, _IN_USE.lookup, _IN_USE.problem = ENGLISH, None, ""
    _finished.cache_clear()
    code = wanted(choice)
    if code not in LOCALE:
        return ""
    own = QTranslator(application)
    path = folder / f"lumenpilot_{LOCALE[code]}.qm"
    if not own.load(str(path)) or own.isEmpty():
        own.deleteLater()
        _IN_USE.problem = f"{path.name} is missing or damaged, so the windows are in English: put back resources/translations"
        return _IN_USE.problem
    application.installTranslator(own)
    of_qt = QTranslator(application)  # buttons and dialogs of Qt itself
    if of_qt.load(f"qtbase_{LOCALE[code]}", QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)):
        application.installTranslator(of_qt)
    _IN_USE.code, _IN_USE.lookup, _IN_USE.problem = code, _looked_up(QCoreApplication.translate), font_problem(code)
    return _IN_USE.problem


def _looked_up(translate: Any) -> Callable[[str], str]:
    return lru_cache(maxsize=4096)(lambda text: str(translate(CONTEXT, text)))


def font_problem(code: str) -> str:
    """Empty, or one line: no font has the letters of this language. There must be an application."""
    from PySide6.QtGui import QFontDatabase

    if code != CHINESE or QFontDatabase.families(QFontDatabase.WritingSystem.SimplifiedChinese):
        return ""
    return "No font with Chinese letters is installed, so they show as boxes: install the package fonts-noto-cjk"

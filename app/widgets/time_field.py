"""Where one types a time as the clock shows it: 1:23.4, or plain seconds."""

from __future__ import annotations

import re

from PySide6.QtGui import QValidator
from PySide6.QtWidgets import QSpinBox

from app.session_marks import clock_text

_TYPED = re.compile(r"(?:(?:(\d+):)?(\d+):)?(\d+(?:[.,]\d*)?|[.,]\d+)(?: *(ms|s))?")
_UNFINISHED = re.compile(r"[\d:., ms]*")
_MS = {"ms": 1.0, "s": 1000.0, None: 1000.0}


def typed_ms(text: str) -> int | None:
    """Milliseconds of "1:02:03.5", "1:23.4", "83.4", "83.4 s" or "83400 ms", with a decimal point or comma; None for no time."""
    found = _TYPED.fullmatch(text.strip())
    if found is None or (found[2] is not None and found[4] == "ms"):
        return None
    minutes = 60 * int(found[1] or 0) + int(found[2] or 0)
    return round(60_000 * minutes + float(found[3].replace(",", ".")) * _MS[found[4]])


class TimeField(QSpinBox):
    """Its value is in milliseconds. What is no time is not taken: leaving the field shows the value again."""

    def textFromValue(self, value: int) -> str:
        return clock_text(value / 1000)

    def valueFromText(self, text: str) -> int:
        found = typed_ms(text)
        return self.value() if found is None else min(found, self.maximum())

    def validate(self, text: str, position: int) -> object:
        if typed_ms(text) is not None:
            return QValidator.State.Acceptable, text, position
        is_begun = _UNFINISHED.fullmatch(text) is not None
        return (QValidator.State.Intermediate if is_begun else QValidator.State.Invalid), text, position

    def fixup(self, text: str) -> str:
        """What was typed is no time: the value as it is."""
        return self.textFromValue(self.value())

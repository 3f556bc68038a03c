"""A titled panel, so that every panel of a window looks the same."""

from __future__ import annotations

from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QLayout, QVBoxLayout, QWidget


class Card(QFrame):
    """A rounded panel; with a title, it has a small head line with an optional note on the right."""

    def __init__(self, title: str, content: QWidget | QLayout, note: QWidget | str = "") -> None:
        super().__init__()
        self.setObjectName("card")
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 7, 12, 9)
        column.setSpacing(4)
        if title:
            column.addLayout(_head(title, note))
        if isinstance(content, QWidget):
            column.addWidget(content, 1)
        else:
            column.addLayout(content, 1)


def _head(title: str, note: QWidget | str) -> QHBoxLayout:
    row = QHBoxLayout()
    row.setSpacing(8)
    label = QLabel(title)
    label.setObjectName("card_title")
    row.addWidget(label)
    row.addStretch(1)
    if isinstance(note, str):
        note_label = QLabel(note)
        note_label.setObjectName("card_note")
        note = note_label
    row.addWidget(note)
    return row

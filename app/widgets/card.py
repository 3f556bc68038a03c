"""A titled panel, so that every panel of a window looks the same."""

from __future__ import annotations

from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QLayout, QVBoxLayout, QWidget


class Card(QFrame):
    """A rounded panel with a small title and, on the right of it, an optional note."""

    def __init__(self, title: str, content: QWidget | QLayout, note: QWidget | str = "") -> None:
        super().__init__()
        self.setObjectName("card")
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 8, 12, 10)
        column.setSpacing(6)
        head = QHBoxLayout()
        head.setSpacing(8)
        label = QLabel(title)
        label.setObjectName("card_title")
        head.addWidget(label)
        head.addStretch(1)
        if isinstance(note, str):
            note_label = QLabel(note)
            note_label.setObjectName("card_note")
            note = note_label
        head.addWidget(note)
        column.addLayout(head)
        if isinstance(content, QWidget):
            column.addWidget(content, 1)
        else:
            column.addLayout(content, 1)

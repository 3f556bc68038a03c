"""A line for a note that goes into a file."""

from __future__ import annotations

from PySide6.QtWidgets import QLineEdit

from app import theme
from app.language import tr

_MOST_LETTERS = 2000


class NoteField(QLineEdit):
    """`hint` stands in it while it is empty; `edge` is the role of its frame's colour, which the focus makes bright."""

    def __init__(self, hint: str, edge: str = "LINE") -> None:
        super().__init__()
        self.setPlaceholderText(hint)
        self.setAccessibleName(tr("Note"))
        self.setMaxLength(_MOST_LETTERS)
        theme.set_sheet(
            self,
            f"QLineEdit {{ background: @PANEL; color: @TEXT; border: 1px solid @{edge}; border-radius: 6px; padding: 5px 10px; }}"
            " QLineEdit:focus { border-color: @SKY; }",
        )

    @property
    def kept_text(self) -> str:
        """What is written, as a file can hold it: half of a surrogate pair, pasted, becomes a question mark."""
        return self.text().encode("utf-8", errors="replace").decode("utf-8").strip()

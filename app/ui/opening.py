"""Windows that this one opens, each a process of its own: a session in the player, everything else in the annotator."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QMimeData, QObject, Signal

from app.ui.i18n import tr, tr_text
from app.ui.workers import ChildProcess, command_of
from core.session.manifest import MANIFEST


class OtherWindows(QObject):
    """The windows that were opened from this one; they stay open when it closes.

    ``said`` carries a line for the user, and whether it is a fault.
    """

    said = Signal(str, bool)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._children: list[ChildProcess] = []

    def open(self, words: str, *arguments: str) -> None:
        """Start a command that opens a window; `words` say so meanwhile."""
        child = ChildProcess(command_of(*arguments), self, priority=0)
        child.ended.connect(lambda code, line: self._on_ended(child, code, line))
        self._children.append(child)
        self.said.emit(words, False)
        child.start()

    def open_path(self, path: Path, *options: str) -> None:
        """The player for a session, or a file in one; the annotator, with these `options`, for everything else."""
        session = next((at for at in (path, path.parent) if (at / MANIFEST).is_file()), None)
        if session is not None:
            self.open(tr("Opening the player: {name}", name=session.name), "play", str(session))
        else:
            self.open(tr("Opening the annotator: {name}", name=path.name), "annotate", str(path), *options)

    def leave(self) -> None:
        """This window closes; nothing more is said of the others."""
        for child in self._children:
            child.leave()

    def _on_ended(self, child: ChildProcess, code: int, line: str) -> None:
        self._children.remove(child)
        child.deleteLater()
        if code != 0:
            self.said.emit(tr_text(line) or tr("That window ended with exit code {code}", code=code), True)


def dropped_paths(data: QMimeData) -> list[Path]:
    """The files and folders of a drag; an empty list for anything else."""
    return [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]

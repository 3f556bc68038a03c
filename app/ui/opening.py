"""Windows that this one opens, each a process of its own: a session in the player, everything else in the annotator."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QMimeData, QObject, Signal
from PySide6.QtWidgets import QMenu, QWidget

from app.ui.i18n import tr, tr_text
from app.ui.layout_state import layout_settings
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


_RECENT, _MOST_RECENT = "recent", 9


def recent_paths() -> list[Path]:
    """What was opened last in annotator or player, the newest first; some may be gone."""
    kept = layout_settings().value(_RECENT) or []
    return [Path(text) for text in ([kept] if isinstance(kept, str) else kept)]  # an INI file gives back one of one as it is


def note_recent(path: Path) -> None:
    """`path` is opened now; a disk that refuses is ignored."""
    settings = layout_settings()
    settings.setValue(_RECENT, [str(one) for one in dict.fromkeys([path.resolve(), *recent_paths()])][:_MOST_RECENT])
    settings.sync()


class RecentMenu(QMenu):
    """What was opened last; `open_path` gets the one that is chosen."""

    def __init__(self, parent: QWidget, open_path: Callable[[Path], None]) -> None:
        super().__init__(parent)
        self._open_path = open_path
        self.aboutToShow.connect(self._fill)

    def _fill(self) -> None:
        self.clear()
        for number, path in enumerate(recent_paths(), start=1):
            folder = str(path.parent).replace(str(Path.home()), "~", 1).replace("&", "&&")
            self.addAction(f"&{number}  {path.name.replace('&', '&&')}\t{folder}", partial(self._open_path, path))
        if self.isEmpty():
            self.addAction(tr("Nothing was opened yet")).setEnabled(False)

"""What a window opens and starts beside itself: other windows, commands, files; and the dialog that asks for a path.

Windows and commands are processes of their own: a session opens in the player, everything else in the annotator.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from PySide6.QtCore import QMimeData, QObject, Qt, QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFileDialog, QMenu, QWidget

from app.ui.i18n import tr, tr_text
from app.ui.layout_state import layout_settings
from app.ui.workers import NOT_STARTED, ChildProcess, command_of
from app.widgets.messages import Offer, OfferButton
from core.session.manifest import MANIFEST

FRAMES = 48
"""Pictures of a session that are annotated, evenly over its time: as many as in the paper."""
_CANCELLED = 130, -signal.SIGTERM
"""Exit codes of a command that was asked to end."""


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
            self.play(session)
        else:
            self.open(tr("Opening the annotator: {name}", name=path.name), "annotate", str(path), *options)

    def play(self, session: Path) -> None:
        """The player, with everything as it was understood."""
        self.open(tr("Opening the player: {name}", name=session.name), "play", str(session))

    def annotate(self, session: Path, rows: str = "") -> None:
        """The annotator on pictures evenly over a session, or on those of `rows`, as ``annotate --rows`` takes them."""
        options = ("--rows", rows) if rows else ("--frames", str(FRAMES), "--order", "even")
        self.open(tr("Opening the annotator: {name}", name=session.name), "annotate", str(session), *options)

    def open_library(self, folder: Path) -> None:
        """All sessions of a folder."""
        self.open(tr("Opening the library"), "library", str(folder))

    def leave(self) -> None:
        """This window closes; nothing more is said of the others."""
        for child in self._children:
            child.leave()

    def _on_ended(self, child: ChildProcess, code: int, line: str) -> None:
        self._children.remove(child)
        child.deleteLater()
        if code != 0:
            self.said.emit(tr_text(line) or tr("That window ended with exit code {code}", code=code), True)


class Offers(Protocol):
    """Where offers are shown."""

    def offer(self, offer: Offer) -> None: ...
    def withdraw(self, key: str) -> None: ...


class OfferedCommand(QObject):
    """A command that runs beside the window; an offer shows how far it is, with a button that asks it to end.

    ``ended`` carries what the command told at its end (None: it failed or was cancelled), a line that says why it told nothing, and
    whether that is a fault.
    """

    ended = Signal(object, str, bool)

    def __init__(self, parent: QObject, offers: Offers, words: str, *arguments: str) -> None:
        super().__init__(parent)
        self._offers, self._words, self._key = offers, words, f"command {id(self)}"
        self._told: dict[str, Any] = {}
        self._is_cancelled = False
        self._child = ChildProcess(command_of(*arguments), self)
        self._child.told.connect(self._on_told)
        self._child.ended.connect(self._on_ended)
        self._show(-1.0, "")

    def start(self) -> None:
        """Start it, unless it was asked to end before that."""
        if self._is_cancelled:
            self._on_ended(-signal.SIGTERM, "")
        else:
            self._child.start()

    def cancel(self, why: str) -> None:
        """It is not started, and `why`."""
        self._on_ended(NOT_STARTED, why)

    def leave(self, *, end: bool = False) -> None:
        """The window closes: nothing more is said of it; with `end` it is asked to end, too."""
        self._child.leave()
        if end:
            self._end()

    def _end(self) -> None:
        self._is_cancelled = True
        self._child.ask_to_end()

    def _on_told(self, record: dict[str, Any]) -> None:
        if record.get("done") is None:
            self._told.update(record)
            return
        done, total, what = record["done"], record["total"], record["what"]
        share = min(1.0, done / total) if total else -1.0
        left = tr(", {left:.0f} s left", left=record["left_s"]) if record.get("left_s") else ""
        if what == "bytes read":
            self._show(share, f"{100 * max(0.0, share):.0f} %{left}")
        else:
            values = {"done": done, "total": total or 0, "what": tr_text(what), "left": left}
            self._show(share, tr("{done:.0f} of {total:.0f} {what}{left}", **values))

    def _show(self, share: float, detail: str) -> None:
        cancel = OfferButton(tr("Cancel"), self._end, tr("Stop it"))
        self._offers.offer(Offer(self._key, self._words, detail, (cancel,), share=share, dismissed=self._end))

    def _on_ended(self, code: int, line: str) -> None:
        self._offers.withdraw(self._key)
        if code in _CANCELLED:
            self.ended.emit(None, tr("Cancelled"), False)
        elif code:
            self.ended.emit(None, line or tr("Ended with exit code {code}", code=code), True)
        else:
            self.ended.emit(self._told, "", False)
        self.deleteLater()


def open_file(path: Path) -> bool:
    """Show a file or folder with whatever the desktop shows such with; False when it cannot."""
    return QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))


def ask_path(
    parent: QWidget,
    title: str,
    start: Path,
    then: Callable[[Path], object],
    mode: QFileDialog.FileMode = QFileDialog.FileMode.ExistingFile,
    filters: Sequence[str] = (),
    *,
    folders_only: bool = False,
) -> QFileDialog:
    """Ask for a file or folder; `then` gets each one that is chosen. The dialog blocks nothing: STOP stays within reach.

    It opens at `start`: a folder, or a file whose name is proposed. One that still asks for the same is raised and returned, with
    what was typed. `folders_only` lists no files.
    """
    name = " ".join((title, mode.name, *filters))
    there: QFileDialog | None = parent.findChild(QFileDialog, name, Qt.FindChildOption.FindDirectChildrenOnly)
    if there is not None and there.isVisible():
        there.raise_()
        there.activateWindow()
        return there
    dialog = QFileDialog(parent, title, str(start), fileMode=mode)
    dialog.setObjectName(name)
    dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
    dialog.setOption(QFileDialog.Option.ShowDirsOnly, folders_only)
    if filters:
        dialog.setNameFilters(filters)
    if mode is QFileDialog.FileMode.AnyFile:
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setOption(QFileDialog.Option.DontConfirmOverwrite)  # the commands that write never overwrite
    dialog.filesSelected.connect(lambda chosen: [then(Path(path)) for path in chosen])
    dialog.finished.connect(dialog.deleteLater)
    dialog.show()
    return dialog


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

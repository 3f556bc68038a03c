"""Browse...: chooses the file or folder that a setting names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFileDialog, QMenu, QPushButton

from app.language import mark, tr
from app.sources import VIDEO_ENDINGS
from core.config import RESOURCES
from core.rig_file import rigs_folder

_VIDEOS = " ".join(f"*{ending}" for ending in (*VIDEO_ENDINGS, ".bag"))
_MODELS = RESOURCES / "models"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a setting names. ``filter`` is for files; where `files` and `folders` are both True a menu asks which."""

    title: str
    files: bool = False
    folders: bool = False
    filter: str = mark("All files (*)")


WANTED = {
    "rig.source": Wanted(
        mark("Pictures to play"),
        files=True,
        folders=True,
        filter=f"Videos and recordings ({_VIDEOS});;All files (*)",
    ),
    "rig.file": Wanted(mark("Rig file"), files=True, filter=mark("Rigs (*.toml)")),
    "perception.segmentation.model": Wanted(mark("Model folder"), folders=True),
    "window.pictures_folder": Wanted(mark("Folder for snapshots"), folders=True),
    "record.folder": Wanted(mark("Folder for sessions"), folders=True),
}
"""The settings that name a file or folder of the disk, by their keys."""


class BrowseButton(QPushButton):
    """``chosen`` has the path. The dialog leaves the window in reach, so that STOP is, too."""

    chosen = Signal(str)

    def __init__(self, key: str, title: str) -> None:
        super().__init__(tr("Browse..."))
        self._key, self._wanted = key, WANTED[key]
        self.dialog: QFileDialog | None = None
        self.entry = ""
        """What stands in the field: the dialog begins there."""
        self.setAccessibleName(tr("Browse for {title}", title=title))
        self.setToolTip(tr("{title}: choose it on the disk", title=tr(self._wanted.title)))
        if self._wanted.files and self._wanted.folders:
            menu = QMenu(self)
            menu.addAction(tr("&File..."), lambda: self.browse(folders=False))
            menu.addAction(tr("F&older..."), lambda: self.browse(folders=True))
            self.setMenu(menu)
        else:
            self.clicked.connect(lambda _on=False: self.browse(folders=self._wanted.folders))

    def browse(self, *, folders: bool) -> None:
        """Open the dialog."""
        if self.dialog is not None:
            self.dialog.raise_()
            return
        dialog = QFileDialog(self.window(), tr(self._wanted.title), str(self._start()))
        dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
        if folders:
            dialog.setFileMode(QFileDialog.FileMode.Directory)
            dialog.setOption(QFileDialog.Option.ShowDirsOnly)
        else:
            dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
            dialog.setNameFilters(self._wanted.filter.split(";;"))
        dialog.fileSelected.connect(self._on_selected)
        dialog.finished.connect(self._on_finished)
        self.dialog = dialog
        dialog.show()  # not open(): nothing may cover STOP

    def _on_selected(self, path: str) -> None:
        chosen = Path(path)
        self.chosen.emit(chosen.name if chosen.parent == _MODELS else path)  # a shipped model goes by its name

    def _on_finished(self) -> None:
        dialog, self.dialog = self.dialog, None
        if dialog is not None:
            dialog.deleteLater()

    def _start(self) -> Path:
        """The nearest folder that is there."""
        usual = {"rig.file": rigs_folder(), "perception.segmentation.model": _MODELS}.get(self._key, Path.home())
        entry = Path(self.entry).expanduser() if "/" in self.entry else usual
        return next((path for path in (entry, *entry.parents) if path.is_dir()), Path.home())

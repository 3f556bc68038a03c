"""The annotator's File menu: open, import, export, and reports, which other processes make from a copy of the annotation file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog

from app.annotator.model import AnnotationModel
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import OfferedCommand, ask_path, open_file
from app.ui.workers import Worker
from app.widgets.messages import OfferStrip
from core.annotation.formats import FORMATS

if TYPE_CHECKING:
    from app.ui.window_base import WindowFrame

IMPORTED = tuple({one.ending for one in FORMATS.values()} - {".png"})
"""Endings of files that are imported when they are dropped; a dropped picture is opened."""
_EXPORTS = {
    "dataset": mark("Training set (a folder)"),
    "csv": mark("Table for evaluate (*.csv)"),
    "angles": mark("Angles over time, with a figure (*.csv)"),
}
"""What can be exported besides ``FORMATS``, as the file dialog lists it."""
_ENDING = {"csv": ".csv", "angles": ".csv"} | {one.name: one.ending for one in FORMATS.values() if one.writes_file}


class AnnotationFiles(QObject):
    """``said`` carries a line for the rater and whether it is a fault.

    Parameters
    ----------
    window : over which dialogs open.
    model : whose annotations are meant.
    offers : where it is shown how long work goes.
    paths : where the images are.
    """

    said = Signal(str, bool)

    def __init__(self, window: WindowFrame, model: AnnotationModel, offers: OfferStrip, paths: Sequence[Path]) -> None:
        super().__init__(window)
        self._window, self._model, self._offers = window, model, offers
        self._paths = [str(path) for path in paths] or [str(model.store.path.parent)]
        self._command: OfferedCommand | None = None
        self._copy = model.store.path.with_name(f".copy_{os.getpid()}_{model.store.path.name}")
        self._copying = Worker("copying", self)
        self._copying.done.connect(lambda start, _result: start())
        self._copying.failed.connect(self._on_not_copied)
        model.imported.connect(self._on_imported)

    def _on_not_copied(self, _start: object, line: str) -> None:
        if self._command is not None:
            self._command.cancel(line)

    @property
    def _study(self) -> str:
        return self._model.items[0].key.study

    # ---- open and import

    def ask_open(self) -> None:
        """A folder of pictures or a session, in a window of its own."""
        folder, mode = self._model.store.path.parent, QFileDialog.FileMode.Directory
        ask_path(self._window, tr("A folder of pictures, or a session"), folder, self._window.open_path, mode)

    def ask_import(self) -> None:
        folder, mode = self._model.store.path.parent, QFileDialog.FileMode.ExistingFiles
        ask_path(self._window, tr("Files of other programs"), folder, lambda path: self._model.import_files([path]), mode)

    def _on_imported(self, count: int, problems: Sequence[str]) -> None:
        if count:
            self.said.emit(tr("{count} images got annotations", count=count), False)
        if problems:
            more = tr(" (and {count} more)", count=len(problems) - 1) if len(problems) > 1 else ""
            self.said.emit(tr_text(problems[0]) + more, not count)
        elif not count:
            self.said.emit(tr("Nothing was imported"), True)

    # ---- export and reports

    def ask_export(self) -> None:
        """Where to, and as what."""
        filters = {tr(text): name for name, text in _EXPORTS.items()}
        filters |= {f"{one.title} (*{_ENDING.get(one.name, '')})": one.name for one in FORMATS.values() if one.write is not None}

        def export(path: Path) -> None:
            self.export(filters[dialog.selectedNameFilter()], path)

        folder, mode = self._model.store.path.parent, QFileDialog.FileMode.AnyFile
        dialog = ask_path(self._window, tr("Export as"), folder, export, mode, list(filters))

    def export(self, name: str, out: Path) -> None:
        """Write `out` as one of the exports of ``annotate``."""
        ending = _ENDING.get(name, "")
        out = out if out.suffix == ending or not ending else out.with_name(out.name + ending)
        arguments = ["annotate", *self._paths, "--store", str(self._copy), "--export", name, "--out", str(out)]
        self._run(tr("Exporting {name}", name=out.name), [*arguments, "--study", self._study], out)

    def report(self) -> None:
        """How well the raters agree, opened in the browser."""
        out = self._model.store.path.with_name(f"report_{self._study}" if self._study else "report")
        arguments = ["annotate", *self._paths, "--store", str(self._copy), "--report", "--out", str(out), "--study", self._study]
        self._run(tr("Comparing the raters"), arguments, out / "report.html")

    def evaluate(self) -> None:
        """The algorithm against these answers, opened in the browser."""
        out = self._model.store.path.with_name("evaluation")
        arguments = ["evaluate", str(self._copy), "--out", str(out), "--progress-json", "--study", self._study]
        self._run(tr("The algorithm perceives the images"), arguments, out / "report.html")

    def _run(self, words: str, arguments: Sequence[str], result: Path) -> None:
        if self._command is not None:
            self.said.emit(tr("Wait until the other one is done"), False)
            return
        self._model.settle()
        self._command = command = OfferedCommand(self, self._offers, words, *arguments)
        command.ended.connect(partial(self._on_ended, result))
        self._copying.submit(command.start, partial(self._model.store.copy_to, self._copy))

    def _on_ended(self, result: Path, told: object, line: str, is_fault: bool) -> None:
        self._command = None
        self._copy.unlink(missing_ok=True)
        if told is None:
            self.said.emit(tr_text(line.replace(self._copy.name, self._model.store.path.name)), is_fault)
            return
        self.said.emit(tr("Written: {path}", path=result), False)
        if result.suffix == ".html":
            open_file(result)

    def close(self) -> None:
        if self._command is not None:
            self._command.leave(end=True)
            self._copy.unlink(missing_ok=True)
        self._copying.stop(finish=False)

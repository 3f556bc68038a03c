"""The annotator's File menu: open, import, export, and reports, which other processes make from a copy of the annotation file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFileDialog

from app.annotator.model import AnnotationModel
from app.ui.i18n import mark, tr, tr_text
from app.ui.workers import ChildProcess, Worker, command_of
from app.widgets.messages import Offer, OfferButton, OfferStrip
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
_WORK = "work"
"""Key of the offer that shows the work that goes on."""


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
        self._child: ChildProcess | None = None
        self._copy = model.store.path.with_name(f".copy_{os.getpid()}_{model.store.path.name}")
        self._copying = Worker("copying", self)
        self._copying.done.connect(lambda start, _result: start())
        self._copying.failed.connect(lambda _start, line: self._end(tr_text(line), is_fault=True))
        model.imported.connect(self._on_imported)

    @property
    def _study(self) -> str:
        return self._model.items[0].key.study

    # ---- open and import

    def ask_open(self) -> None:
        """A folder of pictures or a session, in a window of its own."""
        self._ask(tr("A folder of pictures, or a session"), QFileDialog.FileMode.Directory, self._window.open_path)

    def ask_import(self) -> None:
        self._ask(tr("Files of other programs"), QFileDialog.FileMode.ExistingFiles, lambda path: self._model.import_files([path]))

    def _on_imported(self, count: int, problems: Sequence[str]) -> None:
        if count:
            self.said.emit(tr("{count} images got annotations", count=count), False)
        if problems:
            more = tr(" (and {count} more)", count=len(problems) - 1) if len(problems) > 1 else ""
            self.said.emit(tr_text(problems[0]) + more, not count)
        elif not count:
            self.said.emit(tr("Nothing was imported"), True)

    def _ask(self, title: str, mode: QFileDialog.FileMode, then: Any) -> None:
        dialog = QFileDialog(self._window, title, str(self._model.store.path.parent), fileMode=mode)
        dialog.filesSelected.connect(lambda chosen: [then(Path(path)) for path in chosen])
        dialog.finished.connect(dialog.deleteLater)
        dialog.open()

    # ---- export and reports

    def ask_export(self) -> None:
        """Where to, and as what."""
        dialog = QFileDialog(self._window, tr("Export as"), str(self._model.store.path.parent))
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setOption(QFileDialog.Option.DontConfirmOverwrite)  # nothing is written over
        filters = {tr(text): name for name, text in _EXPORTS.items()}
        filters |= {f"{one.title} (*{_ENDING.get(one.name, '')})": one.name for one in FORMATS.values() if one.write is not None}
        dialog.setNameFilters(list(filters))
        dialog.fileSelected.connect(lambda path: self.export(filters[dialog.selectedNameFilter()], Path(path)))
        dialog.finished.connect(dialog.deleteLater)
        dialog.open()

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
        if self._child is not None:
            self.said.emit(tr("Wait until the other one is done"), False)
            return
        self._model.settle()
        self._child = child = ChildProcess(command_of(*arguments), self)
        child.told.connect(lambda record: self._show(words, record))
        child.ended.connect(lambda code, line: self._on_ended(result, code, line))
        self._show(words, {})
        self._copying.submit(child.start, partial(self._model.store.copy_to, self._copy))

    def _show(self, words: str, record: dict[str, Any]) -> None:
        share = record["done"] / record["total"] if record.get("total") else -1.0
        cancel = OfferButton(tr("Cancel"), self.cancel, tr("Stop it"))
        self._offers.offer(Offer(_WORK, words, "", (cancel,), share=share, dismissed=self.cancel))

    def cancel(self) -> None:
        if self._child is not None:
            self._child.leave()
            self._child.kill()
            self._end(tr("Cancelled"), is_fault=False)

    def _on_ended(self, result: Path, code: int, line: str) -> None:
        if code != 0:
            line = line.replace(self._copy.name, self._model.store.path.name)
            self._end(tr_text(line) or tr("It ended with exit code {code}", code=code), is_fault=True)
            return
        self._end(tr("Written: {path}", path=result), is_fault=False)
        if result.suffix == ".html":
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(result)))

    def _end(self, words: str, *, is_fault: bool) -> None:
        self._child = None
        self._copy.unlink(missing_ok=True)
        self._offers.withdraw(_WORK)
        self.said.emit(words, is_fault)

    def close(self) -> None:
        self.cancel()
        self._copying.stop(finish=False)

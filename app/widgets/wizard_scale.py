"""The page on which pixels become millimetres, and bent lines straight."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

from PySide6.QtWidgets import QDoubleSpinBox, QFileDialog, QHBoxLayout, QLabel

from app.board_print import print_board
from app.language import mark, tr, tr_text
from app.widgets.wizard_page import WizardPage, button, mark_main, note, tell
from app.widgets.wizard_picture import Cross, Line, Shape, WizardPicture
from app.wizard_desk import WizardDesk
from core.calibration.board import BoardSpec
from core.calibration.lens import BoardView
from core.errors import UserError
from core.types import Image, Point

_ENOUGH = 3
"""Pictures of the board, in its middle and towards the corners."""


class ScalePage(WizardPage):
    """By a printed board (several pictures), or by two clicks on a known length."""

    name = mark("Scale and lens")
    hint = mark(
        "Print the board at 100 %, lay it flat at the height of the robot, and take three pictures or more: in the middle, then "
        "towards the corners. In the twin it is laid for you. Or click on the two ends of a length that you know."
    )

    def __init__(self, desk: WizardDesk, picture: WizardPicture) -> None:
        super().__init__(desk, picture)
        self.square = _length(18.0, 2.0, 100.0, tr("Side of a square"))
        self.length = _length(100.0, 1.0, 2000.0, tr("Length between the two clicks"))
        self.length.valueChanged.connect(self._on_length)
        self.take_button = button(tr("&Take a picture"), self._take)
        self.solve_button = button(tr("&Calculate"), self._solve)
        self.forget_button = button(tr("Begin &anew"), self._forget)
        self.print_button = button(tr("&Print..."), self._print, tr("Save the board as PDF or PNG"))
        self.clicks_button = button(tr("Two clic&ks"), self._begin_clicks)
        self.clicks_button.setCheckable(True)
        self.main = self.take_button
        self.count = QLabel()
        self.result = note("")
        self._view: BoardView | None = None
        self._clicks: list[Point] = []
        for parts in (
            (QLabel(tr("Board, squares of")), self.square, self.print_button),
            (self.take_button, self.solve_button, self.forget_button),
            (self.count,),
            (QLabel(tr("Known length")), self.length, self.clicks_button),
        ):
            row = QHBoxLayout()
            for part in parts:
                row.addWidget(part, 1 if part is self.take_button else 0)
            row.addStretch(1)
            self.column.addLayout(row)
        self.column.addWidget(self.result)
        self.column.addStretch(1)

    @property
    def is_done(self) -> bool:
        return self.desk.draft is not None and self.desk.draft.scale is not None

    def leave(self) -> None:
        self.still, self._view, self._clicks = None, None, []
        self.clicks_button.setChecked(False)

    def refresh(self) -> None:
        draft = self.desk.draft
        views = len(draft.views) if draft is not None else 0
        for control in (self.take_button, self.solve_button, self.forget_button, self.clicks_button, self.square):
            control.setEnabled(draft is not None and not self.desk.is_busy)
        self.solve_button.setEnabled(self.solve_button.isEnabled() and views > 0)
        self.square.setEnabled(self.square.isEnabled() and views == 0)
        self.main = self.solve_button if views >= _ENOUGH else self.take_button
        for one in (self.take_button, self.solve_button):
            mark_main(one, one is self.main and not self.is_done)
        self.count.setText(
            tr("1 picture of the board taken") if views == 1 else tr("{count} pictures of the board taken", count=views)
        )
        tell(self.result, "\n".join(self._lines()))

    def _lines(self) -> list[str]:
        draft = self.desk.draft
        if draft is None or draft.scale is None:
            return [tr("Not calibrated yet: distances are shown in pixels only.")]
        share = 100 * draft.scale.uncertainty_share
        lines = [
            tr(
                "Scale: {mm_per_px:.4f} mm per pixel, ±{share:.2f} % (by {method}).",
                mm_per_px=draft.scale.mm_per_px,
                share=share,
                method=tr_text(draft.scale.method),
            )
        ]
        if draft.lens is None:
            lines.append(tr("Lens: straight enough; pictures are left as they are."))
        else:
            lines.append(
                tr("Lens: k1 {k1:+.3f}, k2 {k2:+.3f}; from now on pictures are straightened.", k1=draft.lens.k1, k2=draft.lens.k2)
            )
        return lines

    def shapes(self) -> Sequence[Shape]:
        if self._view is not None and self.still is not None:
            return [Cross((float(x), float(y))) for x, y in self._view.pixels]
        found: list[Shape] = [Cross(at, str(k + 1)) for k, at in enumerate(self._clicks)]
        return [*found, Line(*self._clicks)] if len(self._clicks) == 2 else found

    def click(self, x: float, y: float) -> None:
        draft = self.desk.draft
        if not self.clicks_button.isChecked() or draft is None or self.desk.is_busy:
            return
        if len(self._clicks) == 2:
            self._clicks = []
        self._clicks.append((x, y))
        if len(self._clicks) == 2:
            self._solve_clicks()
        self.desk.changed.emit()

    # ---- the board

    def _take(self) -> None:
        draft = self.desk.draft
        if draft is None:
            return
        self.clicks_button.setChecked(False)
        self._clicks = []
        draft.spec = BoardSpec(square_mm=self.square.value())
        self.desk.run(tr("looking for the board"), draft.take_board, self._on_taken)

    def _on_taken(self, given: object) -> None:
        image, view = cast(tuple[Image, BoardView], given)
        self._show_board(image, view)

    def _show_board(self, image: Image, view: BoardView) -> None:
        self.still, self._view = image, view

    def _solve(self) -> None:
        draft = self.desk.draft
        if draft is not None:
            self.desk.run(tr("calculating"), draft.solve_boards, lambda _given: self.leave())

    def _forget(self) -> None:
        if self.desk.draft is not None:
            self.desk.draft.forget_boards()
        self.leave()
        self.desk.changed.emit()

    def _print(self) -> None:
        no_other_program = QFileDialog.Option.DontUseNativeDialog  # which would hear Space, and know nothing of STOP
        name, _ = QFileDialog.getSaveFileName(
            self, tr("Save the board"), "lumenpilot_board.pdf", tr("PDF (*.pdf);;PNG (*.png)"), options=no_other_program
        )
        if name:
            self.save_board(Path(name))

    def save_board(self, path: Path) -> None:
        """Write the board for the printer, and say how to print it."""
        try:
            paper = print_board(path, BoardSpec(square_mm=self.square.value()))
        except UserError as error:
            self.desk.failed.emit(str(error))
        else:
            self.desk.said.emit(tr("{path}: print it on {paper} at 100 %, and measure its line of 100 mm", path=path, paper=paper))

    # ---- two clicks

    def _begin_clicks(self) -> None:
        self.still, self._view, self._clicks = None, None, []
        if self.clicks_button.isChecked():
            self.desk.said.emit(tr("click on both ends of the known length"))
        self.desk.changed.emit()

    def _on_length(self, _length_mm: float) -> None:
        """The length is corrected after the clicks: what stands in the field is what they are apart."""
        if len(self._clicks) == 2 and self.desk.draft is not None and not self.desk.is_busy:
            self._solve_clicks()
            self.desk.changed.emit()

    def _solve_clicks(self) -> None:
        draft = self.desk.draft
        assert draft is not None
        try:
            draft.solve_clicks(self._clicks[0], self._clicks[1], self.length.value())
        except UserError as error:
            self._clicks = []
            self.desk.failed.emit(str(error))


def _length(value: float, low: float, high: float, name: str) -> QDoubleSpinBox:
    made = QDoubleSpinBox()
    made.setRange(low, high)
    made.setDecimals(2)
    made.setValue(value)
    made.setSuffix(" mm")
    made.setAccessibleName(name)
    made.setToolTip(name)
    return made

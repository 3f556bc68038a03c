"""The camera pages of the rig wizard: name and camera of the rig; scale and lens."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFileDialog,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QSpinBox,
)

from app.rig_wizard.board_print import print_board
from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.pages_base import Cross, MeasuredLine, Shape, WizardPage, WizardPicture, note, set_note
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.widgets.basics import button, enable, set_main_button
from core.calibration.camera import BoardSpec, BoardView
from core.config.models import CameraConfig, Config
from core.config.rig_file import check_rig_name, rig_path
from core.devices import UserError
from core.types import Image, Point
from hardware.calibration.rig_draft import RigDraft
from hardware.cameras.registry import FoundCamera
from hardware.rig import FoundDevices, find_devices, with_camera


class CameraPage(WizardPage):
    """The name of the rig and its camera, which is opened here and read until the wizard is closed."""

    name = mark("Camera")
    hint = mark("What is the rig called, and which camera looks at it? Open it: the picture on the right must be sharp and steady.")

    def __init__(self, model: RigWizardModel, picture: WizardPicture, rig_name: str) -> None:
        super().__init__(model, picture)
        self.found = FoundDevices((), ())
        self.ask: Callable[[str, str, Callable[[], None]], None] = lambda _question, _answer, action: action()
        """Asks before something is lost: a question, the answer that does it, and what is done then."""
        self.name_edit = QLineEdit(rig_name, maxLength=60, placeholderText="bench 1")
        self.name_edit.setAccessibleName(tr("Name of the rig"))
        self.name_edit.textChanged.connect(lambda _text: self.model.changed.emit())
        self.cameras = QListWidget()
        self.cameras.setAccessibleName(tr("Cameras"))
        self.cameras.setMinimumHeight(96)
        self.cameras.setMaximumHeight(150)
        self.cameras.itemActivated.connect(lambda _item: self._open())
        self.cameras.currentItemChanged.connect(lambda _item, _before: self._update_size_fields())
        known = model.config.camera
        self.sizes = (
            _spin(known.width_px, 160, 4096, " px", tr("Width")),
            _spin(known.height_px, 120, 4096, " px", tr("Height")),
        )
        self.rate = _spin(known.frames_per_second, 5, 240, " fps", tr("Pictures per second"))
        size = QHBoxLayout()
        for part in (self.sizes[0], QLabel("\N{MULTIPLICATION SIGN}"), self.sizes[1], self.rate):
            size.addWidget(part, 0 if isinstance(part, QLabel) else 1)
        form = QGridLayout()
        form.setColumnStretch(1, 1)
        form.setHorizontalSpacing(theme.GAP)
        labels = QLabel(tr("&Name")), QLabel(tr("&Picture")), QLabel(tr("C&amera"))
        for line, (label, buddy) in enumerate(zip(labels, (self.name_edit, self.sizes[0], self.cameras), strict=True)):
            label.setBuddy(buddy)
            form.addWidget(label, line, 0, Qt.AlignmentFlag.AlignTop if buddy is self.cameras else Qt.AlignmentFlag.AlignVCenter)
        form.addWidget(self.name_edit, 0, 1)
        form.addLayout(size, 1, 1)
        form.addWidget(self.cameras, 2, 1)
        self.add(form)
        self.main = self.open_button = button(tr("&Open the camera"), self._open)
        self.search_button = button(tr("&Search again"), self.search, tr("Look for cameras and ports once more"))
        self.add_row(self.open_button, self.search_button, stretched=self.open_button, fill=True)
        self.problem = note("")
        self.add(self.problem, None)

    @property
    def rig_name(self) -> str:
        return self.name_edit.text().strip()

    @property
    def is_done(self) -> bool:
        return self.model.bench is not None and not self._name_problem()

    @property
    def may_leave(self) -> bool:
        return self.is_done and not self.model.is_busy

    def enter(self) -> None:
        if not self.found.cameras:
            self.search()
        self.refresh()

    def search(self) -> None:
        self.model.run(tr("looking for cameras"), find_devices, self._on_found)

    def refresh(self) -> None:
        enable(not self.model.is_busy, self.open_button, self.search_button, self.cameras)
        self._update_size_fields()
        lines = [self._name_problem(), *self.found.problems]
        if self.model.bench is None and not self.model.is_busy:
            lines.append(tr("Next goes on when the camera is open."))
        if self.model.bench is not None and self.rig_name and rig_path(self.rig_name).exists():
            lines.append(tr("There is a rig {name}: saving replaces it, and keeps the older one beside it.", name=self.rig_name))
        set_note(self.problem, "\n".join(line for line in lines if line))

    def _on_found(self, found: object) -> None:
        assert isinstance(found, FoundDevices)
        self.found = found
        self.cameras.clear()
        for camera in found.cameras:
            item = QListWidgetItem(tr_text(camera.title))
            item.setData(Qt.ItemDataRole.UserRole, camera)
            self.cameras.addItem(item)
        chosen = next((k for k, camera in enumerate(found.cameras) if _is_configured(camera, self.model.config)), 0)
        self.cameras.setCurrentRow(chosen)

    def _update_size_fields(self) -> None:
        """Only for real cameras: the twin's camera has its size in the settings."""
        item = self.cameras.currentItem()
        camera = item.data(Qt.ItemDataRole.UserRole) if item is not None else None
        enable(camera is not None and camera.kind != "twin" and not self.model.is_busy, *self.sizes, self.rate)

    def _open(self) -> None:
        if self.cameras.currentRow() < 0:
            return
        if self.draft is not None and self.draft.has_news:
            self.ask(tr("Open the camera again and lose what was found?"), tr("Open"), self._open_now)
        else:
            self._open_now()

    def _open_now(self) -> None:
        camera, config = self.cameras.currentItem().data(Qt.ItemDataRole.UserRole), self.model.config
        if not _is_configured(camera, config):
            config = with_camera(config, camera)
        wanted: dict[str, object] = {"width_px": self.sizes[0].value(), "height_px": self.sizes[1].value()}
        wanted |= {"frames_per_second": self.rate.value()}
        # By its own identifier: a configuration without one means any camera, and another one may be the first tomorrow.
        wanted |= {"serial": camera.serial} if camera.serial is not None else {}
        wanted |= {"device": camera.device} if camera.kind == "webcam" else {}
        settings = CameraConfig.model_validate({**config.camera.model_dump(), **wanted})
        self.picture.show_text(tr("Opening the camera. The first time the network is loaded, too."))
        self.model.open_camera(config.model_copy(update={"camera": settings}))

    def _name_problem(self) -> str:
        if not self.rig_name:
            return tr("Give the rig a name.")
        try:
            check_rig_name(self.rig_name)
        except ValueError as error:
            text = tr_text(str(error))
            return f"{text[0].upper()}{text[1:]}."
        return ""


def _is_configured(camera: FoundCamera, config: Config) -> bool:
    """Whether a configuration has this camera already, with its settings."""
    if camera.kind != config.rig.camera or config.rig.source is not None:
        return False
    settings = config.camera
    if camera.kind in {"realsense", "basler"}:
        return settings.serial in {None, camera.serial}
    return camera.kind == "twin" or settings.device in {None, camera.device}


def _spin(value: int, low: int, high: int, unit: str, name: str) -> QSpinBox:
    made = QSpinBox()
    made.setRange(low, high)
    made.setValue(value)
    made.setSuffix(unit)
    made.setAccessibleName(name)
    made.setToolTip(tr("{name}; only for real cameras", name=name))
    return made


_ENOUGH = 3
"""Pictures of the board, in its middle and towards the corners."""


class ScalePage(WizardPage):
    """Pixels become millimetres, and bent lines straight: by a printed board (several pictures), or by two clicks."""

    name = mark("Scale and lens")
    hint = mark(
        "Print the board at 100 %, lay it flat at the height of the robot, and take three pictures or more: in the middle, then "
        "towards the corners. In the twin it is laid for you. Or click on the two ends of a length that you know."
    )

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(model, picture)
        self.square = _length(18.0, 2.0, 100.0, tr("Side of a square"))
        self.length = _length(100.0, 1.0, 2000.0, tr("Length between the two clicks"))
        self.length.valueChanged.connect(self._on_length)
        self.main = self.take_button = button(tr("&Take a picture"), self._take)
        self.solve_button = button(tr("&Calculate"), self._solve)
        self.restart_button = button(tr("Start &over"), self._restart)
        self.print_button = button(tr("&Print..."), self._print, tr("Save the board as PDF or PNG"))
        self.clicks_button = button(tr("Click both en&ds"), self._begin_clicks)
        self.clicks_button.setCheckable(True)
        self.count = QLabel()
        self.result = note("")
        self._view: BoardView | None = None
        self._clicks: list[Point] = []
        self.add_row(QLabel(tr("Board, squares of")), self.square, self.print_button)
        self.add_row(self.take_button, self.solve_button, self.restart_button, stretched=self.take_button)
        self.add_row(self.count)
        self.add_row(QLabel(tr("Known length")), self.length, self.clicks_button)
        self.add(self.result, None)

    @property
    def is_done(self) -> bool:
        return self.draft is not None and self.draft.scale is not None

    def leave(self) -> None:
        self._show_live()
        self.clicks_button.setChecked(False)

    def _show_live(self) -> None:
        self.still, self._view, self._clicks = None, None, []

    def refresh(self) -> None:
        views, is_ready = len(self.draft.views) if self.draft is not None else 0, self.draft is not None and not self.model.is_busy
        enable(is_ready, self.take_button, self.clicks_button)
        enable(is_ready and views > 0, self.solve_button, self.restart_button)
        self.square.setEnabled(is_ready and views == 0)
        self.main = self.solve_button if views >= _ENOUGH else self.take_button
        for one in (self.take_button, self.solve_button):
            set_main_button(one, one is self.main and not self.is_done)
        several = tr("{count} pictures of the board taken", count=views)
        self.count.setText(tr("1 picture of the board taken") if views == 1 else several)
        set_note(self.result, "\n".join(self._result_lines()))

    def _result_lines(self) -> list[str]:
        draft = self.draft
        if draft is None or draft.scale is None:
            return [tr("Not calibrated yet: distances are shown in pixels only.")]
        scale, lens = draft.scale, draft.lens
        found = tr(
            "Scale: {mm_per_px:.4f} mm per pixel, ±{share:.2f} % (by {method}).",
            mm_per_px=scale.mm_per_px,
            share=100 * scale.uncertainty_share,
            method=tr_text(scale.method),
        )
        if lens is None:
            return [found, tr("Lens: straight enough; pictures are left as they are.")]
        return [found, tr("Lens: k1 {k1:+.3f}, k2 {k2:+.3f}; from now on pictures are straightened.", k1=lens.k1, k2=lens.k2)]

    def shapes(self) -> Sequence[Shape]:
        if self._view is not None and self.still is not None:
            return [Cross((float(x), float(y))) for x, y in self._view.pixels]
        found: list[Shape] = [Cross(at, str(k + 1)) for k, at in enumerate(self._clicks)]
        return [*found, MeasuredLine(*self._clicks)] if len(self._clicks) == 2 else found

    # ---- the board

    def _take(self) -> None:
        if self.draft is not None:
            self.clicks_button.setChecked(False)
            self._clicks = []
            self.draft.spec = BoardSpec(square_mm=self.square.value())
            self.model.run(tr("looking for the board"), self.draft.take_board, self._on_taken)

    def _on_taken(self, result: object) -> None:
        self.still, self._view = cast(tuple[Image, BoardView], result)

    def _solve(self) -> None:
        if self.draft is not None:
            self.model.run(tr("calculating"), self.draft.solve_boards, lambda _result: self.leave())

    def _restart(self) -> None:
        if self.draft is not None:
            self.draft.forget_boards()
        self.leave()
        self.model.changed.emit()

    def _print(self) -> None:
        in_qt = QFileDialog.Option.DontUseNativeDialog  # one of the desktop would receive Space, and not know STOP
        kinds = tr("PDF (*.pdf);;PNG (*.png)")
        name, _ = QFileDialog.getSaveFileName(self, tr("Save the board"), "lumenpilot_board.pdf", kinds, options=in_qt)
        if name:
            self.save_board(Path(name))

    def save_board(self, path: Path) -> None:
        """Write the board for the printer, and say how to print it."""
        try:
            paper = print_board(path, BoardSpec(square_mm=self.square.value()))
        except UserError as error:
            self.model.failed.emit(str(error))
        else:
            text = tr("{path}: print it on {paper} at 100 %, and measure its line of 100 mm", path=path, paper=paper)
            self.model.message.emit(text)

    # ---- two clicks

    def _begin_clicks(self) -> None:
        self._show_live()
        if self.clicks_button.isChecked():
            self.model.message.emit(tr("click on both ends of the known length"))
        self.model.changed.emit()

    def click(self, x: float, y: float) -> None:
        if not self.clicks_button.isChecked() or self.draft is None or self.model.is_busy:
            return
        if len(self._clicks) == 2:
            self._clicks = []
        self._clicks.append((x, y))
        self._solve_clicks(self.draft)
        self.model.changed.emit()

    def _on_length(self, _length_mm: float) -> None:
        """The length may be corrected after the clicks."""
        if len(self._clicks) == 2 and self.draft is not None and not self.model.is_busy:
            self._solve_clicks(self.draft)
            self.model.changed.emit()

    def _solve_clicks(self, draft: RigDraft) -> None:
        if len(self._clicks) < 2:
            return
        try:
            draft.solve_clicks(self._clicks[0], self._clicks[1], self.length.value())
        except UserError as error:
            self._clicks = []
            self.model.failed.emit(str(error))


def _length(value: float, low: float, high: float, name: str) -> QDoubleSpinBox:
    made = QDoubleSpinBox()
    made.setRange(low, high)
    made.setDecimals(2)
    made.setValue(value)
    made.setSuffix(" mm")
    made.setAccessibleName(name)
    made.setToolTip(name)
    return made

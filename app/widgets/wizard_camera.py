"""First page of the rig wizard: what the rig is called, and which camera it has."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QLineEdit, QListWidget, QListWidgetItem, QSpinBox

from app import theme
from app.language import mark, tr, tr_text
from app.widgets.wizard_page import WizardPage, button, note, tell
from app.widgets.wizard_picture import WizardPicture
from app.wizard_desk import WizardDesk
from core.camera_config import CameraConfig
from core.config import Config
from core.rig_file import check_rig_name, rig_path
from hardware.rig_search import Found, FoundCamera, with_camera


class CameraPage(WizardPage):
    """``name_edit`` is the rig's name. The camera is opened here, and read until the wizard is closed."""

    name = mark("Camera")
    hint = mark("What is the rig called, and which camera looks at it? Open it: the picture on the right must be sharp and steady.")

    def __init__(self, desk: WizardDesk, picture: WizardPicture, rig_name: str) -> None:
        super().__init__(desk, picture)
        self.name_edit = QLineEdit(rig_name)
        self.name_edit.setMaxLength(60)
        self.name_edit.setPlaceholderText("bench 1")
        self.name_edit.setAccessibleName(tr("Name of the rig"))
        self.name_edit.textChanged.connect(lambda _text: self.desk.changed.emit())
        self.cameras = QListWidget()
        self.cameras.setAccessibleName(tr("Cameras"))
        self.cameras.setMinimumHeight(96)
        self.cameras.itemActivated.connect(lambda _item: self._open())
        self.cameras.currentItemChanged.connect(lambda _item, _before: self._offer_size())
        self.sizes = (
            _spin(desk.config.camera.width_px, 160, 4096, " px", tr("Width")),
            _spin(desk.config.camera.height_px, 120, 4096, " px", tr("Height")),
        )
        self.rate = _spin(desk.config.camera.frames_per_second, 5, 240, " fps", tr("Pictures per second"))
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
        self.column.addLayout(form)
        self.cameras.setMaximumHeight(150)
        row = QHBoxLayout()
        self.open_button = button(tr("&Open the camera"), self._open)
        self.main = self.open_button
        self.search_button = button(tr("&Search again"), self.search, tr("Look for cameras and ports once more"))
        row.addWidget(self.open_button, 1)
        row.addWidget(self.search_button)
        self.column.addLayout(row)
        self.problem = note("")
        self.column.addWidget(self.problem)
        self.column.addStretch(1)
        self.found = Found((), ())
        self.ask: Callable[[str, str, Callable[[], None]], None] = lambda _question, _answer, action: action()
        """Asks before something is lost: a question, the answer that does it, and what is done then."""

    @property
    def rig_name(self) -> str:
        return self.name_edit.text().strip()

    @property
    def is_done(self) -> bool:
        return self.desk.bench is not None and not self._name_problem()

    @property
    def may_leave(self) -> bool:
        return self.is_done and not self.desk.is_busy

    def enter(self) -> None:
        if not self.found.cameras:
            self.search()
        self.refresh()

    def search(self) -> None:
        """Find cameras and ports."""
        from hardware import rig_search

        self.desk.run(tr("looking for cameras"), rig_search.search, self._on_found)

    def refresh(self) -> None:
        for control in (self.open_button, self.search_button, self.cameras):
            control.setEnabled(not self.desk.is_busy)
        self._offer_size()
        lines = [self._name_problem(), *self.found.problems]
        if self.desk.bench is None and not self.desk.is_busy:
            lines.append(tr("Next goes on when the camera is open."))
        if self.desk.bench is not None and self.rig_name and rig_path(self.rig_name).exists():
            lines.append(tr("There is a rig {name}: saving replaces it, and keeps the older one beside it.", name=self.rig_name))
        tell(self.problem, "\n".join(line for line in lines if line))

    def _on_found(self, found: object) -> None:
        assert isinstance(found, Found)
        self.found = found
        self.cameras.clear()
        for camera in found.cameras:
            item = QListWidgetItem(tr_text(camera.title))
            item.setData(Qt.ItemDataRole.UserRole, camera)
            self.cameras.addItem(item)
        chosen = next((k for k, camera in enumerate(found.cameras) if _is_of(camera, self.desk.config)), 0)
        self.cameras.setCurrentRow(chosen)

    def _offer_size(self) -> None:
        """The twin's camera has its size in the settings."""
        item = self.cameras.currentItem()
        camera = item.data(Qt.ItemDataRole.UserRole) if item is not None else None
        is_real = camera is not None and camera.kind != "twin" and not self.desk.is_busy
        for field in (*self.sizes, self.rate):
            field.setEnabled(is_real)

    def _open(self) -> None:
        if self.cameras.currentRow() < 0:
            return
        draft = self.desk.draft
        if draft is not None and draft.has_news:
            self.ask(tr("Open the camera anew and lose what was found?"), tr("Open"), self._open_now)
        else:
            self._open_now()

    def _open_now(self) -> None:
        camera = self.cameras.currentItem().data(Qt.ItemDataRole.UserRole)
        config = self.desk.config
        if not _is_of(camera, config):
            config = with_camera(config, camera)
        wanted: dict[str, object] = {"width_px": self.sizes[0].value(), "height_px": self.sizes[1].value()}
        wanted |= {"frames_per_second": self.rate.value()}
        # By its own sign: a configuration that names none means any, and another one may be the first tomorrow.
        wanted |= {"serial": camera.serial} if camera.kind == "realsense" else {}
        wanted |= {"device": camera.device} if camera.kind == "webcam" else {}
        settings = CameraConfig.model_validate({**config.camera.model_dump(), **wanted})
        self.picture.show_text(tr("Opening the camera. The first time the network is loaded, too."))
        self.desk.open_camera(config.model_copy(update={"camera": settings}))

    def _name_problem(self) -> str:
        if not self.rig_name:
            return tr("Give the rig a name.")
        try:
            check_rig_name(self.rig_name)
        except ValueError as error:
            text = tr_text(str(error))
            return f"{text[0].upper()}{text[1:]}."
        return ""


def _is_of(camera: FoundCamera, config: Config) -> bool:
    """Whether a configuration has this camera already, with its settings."""
    if camera.kind != config.rig.camera or config.rig.source is not None:
        return False
    settings = config.camera
    if camera.kind == "realsense":
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

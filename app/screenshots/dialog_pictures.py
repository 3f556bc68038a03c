"""Settings, checks before driving, training, rig wizard and servo table, each by itself."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from app.preflight_desk import PreflightDesk
from app.rig_wizard import RigWizard
from app.screenshots.shots import Studio
from app.settings_dialog import SettingsDialog
from app.settings_model import SettingsDraft
from app.training_dialog import TrainingDialog
from app.training_job import Wish
from app.training_source import collect_from_file
from app.widgets.card import Card
from app.widgets.preflight_list import PreflightList
from app.widgets.servo_table import ServoTable
from app.wizard_desk import WizardDesk
from core.config import Config, load_config
from core.control.drive_view import DriveView
from core.errors import UserError
from core.learning.dataset import write_png
from core.profiles import Profiles
from core.servo_config import ServosConfig
from core.study.annotation_images import find_images
from core.study.annotation_records import ItemKey
from core.study.annotation_store import DEFAULT_NAME, AnnotationStore
from core.study.annotations import Annotation, MaskTarget, View, measure_lines
from core.study.mask_polygons import polygons_of
from core.types import Frame, Reason, Refusal, Scene
from hardware.calibration_bench import CalibrationBench
from hardware.servos.bus_messages import BusPhase, BusStatus, CycleTimes
from hardware.servos.line import LineCounts
from hardware.servos.status_block import HardwareError, ServoState
from hardware.twin.world import TwinWorld

_SOMEBODY = "/data/LumenPilot"
"""Whose computer the pictures show."""
_BOARDS = 5
_PHANTOMS = ("tree", "y_branch", "s_curve", "aortic_arch", "tortuous", "tree")
_STEPS, _SHOWN_STEP, _SHOWN_LOOKS, _REMEMBERED = 40, 12, 4, 2
_TRAINING_S = 1800.0


def settings(studio: Studio) -> None:
    """A section with a limit that was changed and is not saved."""
    profiles = Profiles(studio.folder / "profiles")
    dialog = SettingsDialog(SettingsDraft(load_config()), Path("~/.config/LumenPilot/settings.toml"), profiles)
    dialog.show()
    key = "perception.pose.d_allow_px"
    dialog.go_to(key)
    dialog.page.edited.emit(key, "8")
    studio.wait(0.3)
    studio.take(dialog, "settings")
    studio.close(dialog)


def preflight(studio: Studio) -> None:
    """The checks themselves, in a process of their own, as they are made before arming."""
    config = studio.config.model_copy(update={"record": studio.config.record.model_copy(update={"folder": _SOMEBODY})})
    desk = PreflightDesk(lambda: config, lambda: DriveView(0.0))
    checks = PreflightList(desk)
    try:
        desk.begin()
        studio.until(lambda: not desk.preflight.is_running, "the checks before driving")
        checks.open_list()
        studio.wait(0.3)
        studio.take(checks, "preflight")
    finally:
        desk.close()
        studio.close(checks)


def training(studio: Studio) -> None:
    """A training on frames of the twin in false colours, while it goes on."""
    folder = studio.folder / "own"
    folder.mkdir()
    store = _masks_by_hand(folder, studio.config)
    with _data_folder(studio.folder / "data"):
        dialog = TrainingDialog(partial(collect_from_file, store), f"{_SOMEBODY}/{DEFAULT_NAME}")
        dialog.steps.setValue(_STEPS)
        dialog.show()
        try:
            dialog.job.start(Wish(dialog.name.text(), steps=_STEPS, remember=_REMEMBERED))

            def far_enough() -> bool:
                state = dialog.job.state
                if not state.is_busy:
                    raise UserError(dialog.line)
                return state.step >= _SHOWN_STEP and len(state.looks) >= _SHOWN_LOOKS

            studio.until(far_enough, "the training", _TRAINING_S)
            studio.wait(0.3)
            studio.take(dialog, "training")
            dialog.job.stop()
            studio.until(lambda: not dialog.is_busy, "the end of the training", _TRAINING_S)
        finally:
            dialog.end()
            studio.close(dialog)


@contextmanager
def _data_folder(folder: Path) -> Iterator[None]:
    """The model that comes of it is not to stay among the user's own."""
    before = os.environ.get("XDG_DATA_HOME")
    os.environ["XDG_DATA_HOME"] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ["XDG_DATA_HOME"]
        else:
            os.environ["XDG_DATA_HOME"] = before


def _masks_by_hand(folder: Path, config: Config) -> Path:
    """Pictures in false colours, with the true masks as somebody would have drawn them; returns the annotation file."""
    masks = []
    for k, phantom in enumerate(_PHANTOMS):
        world = TwinWorld(config.twin.model_copy(update={"phantom": phantom}), perception=config.perception, seed=k)
        world.insert(50.0 + 6.0 * k)
        seen = world.picture(world.physics.robot_points_mm())
        write_png(folder / f"{k:02d}_{phantom}.png", np.ascontiguousarray(255 - seen.image[..., ::-1]))
        masks.append(polygons_of(seen.vessel, MaskTarget.VESSEL) + polygons_of(seen.robot, MaskTarget.ROBOT))
    path = folder / DEFAULT_NAME
    with AnnotationStore(path) as store:
        for image, drawn in zip(find_images(sorted(folder.glob("*.png")), store)[0], masks, strict=True):
            content, key = Annotation(masks=drawn), ItemKey(image.sha256, "", "anna", 1)
            entry = store.history(key).edit("drawn", content)
            assert entry is not None
            store.save(key, View.AS_IS, entry, content, measure_lines(content, image.record.size, config.perception), 1.0)
    return path


def rig_wizard(studio: Studio) -> None:
    """The page of scale and lens, with the board found in its last picture."""
    desk = WizardDesk(studio.config, None, _open_bench, lambda _config: _see_nothing)
    wizard = RigWizard(desk, "bench 1")
    wizard.resize(1074, 580)
    wizard.show()
    idle = "the rig wizard"
    try:
        studio.until(lambda: not desk.is_busy, idle)
        wizard.camera_page.open_button.click()
        studio.until(lambda: not desk.is_busy, idle)
        wizard.next()
        page = wizard.scale_page
        for button in (*[page.take_button] * _BOARDS, page.solve_button, page.take_button):
            button.click()
            studio.until(lambda: not desk.is_busy, idle)
        studio.wait(0.3)
        studio.take(wizard, "rig_wizard")
    finally:
        wizard.reject()
        studio.close(wizard)


def _open_bench(config: Config, see: object) -> CalibrationBench:
    return CalibrationBench(config, _TwinCamera(config), None, _see_nothing, lambda: None)


def _see_nothing(frame: Frame) -> Scene:
    height, width = frame.image.shape[:2]
    return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=Refusal(Reason.NO_ROBOT))


class _TwinCamera:
    """The twin, standing still."""

    name = "bench twin"
    is_live = False

    def __init__(self, config: Config) -> None:
        world = TwinWorld(config.twin, perception=config.perception, seed=0)
        world.insert(60.0)
        self._frame = world.frame(0.0)

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        time.sleep(min(timeout_s, 0.05))
        return replace(self._frame, captured_s=time.monotonic())


def servo_table(studio: Studio) -> None:
    """Seven servos, of which one is warm, one pulls near its end, and one was not zeroed."""
    servos = ServosConfig()
    table = ServoTable(clock=lambda: 0.0)
    card = Card("", table)
    card.resize(700, 320)
    card.show()
    table.show_status(_bus(servos), servos)
    studio.wait(0.3)
    studio.take(card, "servo_table")
    studio.close(card)


def _bus(servos: ServosConfig) -> BusStatus:
    places_mm = (2.60, -1.95, 0.30, 0.30, 62.4, 20.0, None)
    currents_ma = (86.0, 11.0, 24.0, 27.0, 41.0, 19.0, 3.0)
    readings = tuple(
        ServoState(
            joint.name, joint.id, 0.0, 1000, 1000, at_mm, at_mm, 0.0, current_ma, 11.9,
            66.0 if joint.name == "right" else 34.0, HardwareError(0), torque=True, watchdog_tripped=False,
        )
        for joint, at_mm, current_ma in zip(servos.joints, places_mm, currents_ma, strict=True)
    )  # fmt: skip
    return BusStatus(
        cycle=1,
        time_s=0.0,
        phase=BusPhase.DISARMED,
        servos=readings,
        active=(),
        latched=None,
        fault_counts={},
        sent=None,
        rejection=None,
        clamps=(),
        at_end=(),
        rejections={},
        clamp_count=0,
        line=LineCounts(),
        bad_packets=0,
        restarts=0,
        times=CycleTimes(20.0, 21.4, 4.0, 6.0),
        zeroed=tuple(at_mm is not None for at_mm in places_mm),
    )

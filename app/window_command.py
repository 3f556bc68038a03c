"""Opens the operator window on a rig."""

from __future__ import annotations

import gc
import json
import logging
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.application import check_display, make_application, run_until_closed
from app.sources import VIDEO_ENDINGS
from core.config import Config, load_config, merge
from core.devices import DeviceError
from core.errors import UserError
from core.images import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS
from core.perception.compiled import loops
from core.profiles import settings_of_windows
from core.rig_file import RESERVED, find_rig, with_rig
from core.types import Reason
from hardware.rig import RigKind, kind_of, start_ahead
from hardware.twin.phantom import PHANTOM_TITLES

if TYPE_CHECKING:
    from PySide6.QtCore import QTimer

    from app.operator_window import OperatorWindow
    from app.rig_engine import EngineMaker

RIGS = RESERVED
_REALSENSE_ENDING = ".bag"


def window_config(
    rig: str | None, config_path: Path | None, source: Path | None, own: dict[str, Any] | None = None
) -> tuple[Config, RigKind]:
    """The configuration of a rig or of a recorded source, and what the banner says; raises UserError.

    Without `rig` it is the one that the configuration names; with it, the configuration says how that rig is set. `own` is what the
    user has set, over the defaults.
    """
    if rig is not None and source is not None:
        raise UserError("--source is looked at instead of a rig's camera: leave --rig out")
    if source is None:
        config = load_config(config_path, overrides=own)
        if rig is not None:
            config = _choose(config, rig) if rig in RIGS else _from_file(config, rig)
    else:
        try:
            found = source.exists()
        except OSError as error:
            raise DeviceError(f"{source}: cannot be read ({error.strerror})") from None
        if not found:
            raise DeviceError(f"{source}: no such file or folder")
        camera = "video_file" if source.suffix.lower() in VIDEO_ENDINGS else "image_folder"
        camera = "realsense" if source.suffix.lower() == _REALSENSE_ENDING else camera
        if camera == "image_folder" and source.is_file():
            _check_picture(source)
        chosen = {"rig": {"camera": camera, "robot": "none", "source": str(source), "file": None}}
        config = load_config(config_path, overrides=merge(own or {}, chosen))
    return config, kind_of(config.rig)


def _check_picture(file: Path) -> None:
    """A file that is no video by its name must be a picture: said here, and not in a window that would show nothing."""
    try:
        read_image(file)
    except ImageError as error:
        if file.suffix.lower() in IMAGE_ENDINGS:
            raise
        endings = ", ".join((*IMAGE_ENDINGS, *VIDEO_ENDINGS, _REALSENSE_ENDING))
        raise UserError(f"{error}; --source takes a folder of pictures, or a file that ends in {endings}") from None


def _from_file(config: Config, name: str) -> Config:
    """A rig that the wizard has made; raises RigFileError."""
    path, rig = find_rig(name)
    return with_rig(config, rig, path)


def _choose(config: Config, rig: str) -> Config:
    """Another rig than the configuration's own: a real camera drives real servos when their port is known."""
    if config.rig.camera == rig and config.rig.source is None:
        return config
    servos = config.servos
    if rig == "twin":
        robot, servos = "twin", servos.model_copy(update={"port": None})
    else:
        robot = "servos" if servos.port is not None else "none"
    # Without its file: what was calibrated is another camera's.
    chosen = config.rig.model_copy(update={"name": rig, "camera": rig, "robot": robot, "source": None, "file": None})
    return config.model_copy(update={"rig": chosen, "servos": servos})


def finish_loading() -> None:
    """What a window needs is loaded before it is there, and stays, so that later collections of garbage are short.

    Loading holds the interpreter's lock, and so stops the window, for up to a quarter of a second, mostly for such collections.
    """
    loops.load()
    gc.freeze()


def make_window(config: Config, kind: RigKind, maker: EngineMaker | None = None) -> OperatorWindow:
    """The window, not shown yet. There must be an application."""
    from app.operator_window import OperatorWindow
    from app.rig_engine import EngineMaker

    return OperatorWindow(config, maker or EngineMaker(), kind, list(PHANTOM_TITLES.items()))


def run_window(
    rig: str | None, config_path: Path | None, source: Path | None, *, until_first_frame: bool = False, tour: bool = False
) -> int:
    """Show the window until it is closed; returns the exit code. Raises UserError for what is wrong before it opens."""
    check_display()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    file = settings_of_windows(config_path)
    is_own = config_path is None and not until_first_frame  # what is measured does not depend on who measures
    config, kind = window_config(rig, config_path, source, file.data if is_own else None)
    ahead = start_ahead(config)  # before all that is slow to load here

    from app.crash_report import CrashWatch, state_folder
    from app.layout_keeper import LayoutKeeper, Parts, overlay_switches
    from app.operator_devices import OperatorDevices
    from app.rig_desk import RigDesk
    from app.rig_engine import EngineMaker
    from app.settings_desk import SettingsDesk
    from app.side_work import SideWork
    from app.tour import tour_at_start

    finish_loading()
    application = make_application(config.window)
    maker = EngineMaker(ahead)
    window = make_window(config, kind, maker)
    watch = CrashWatch(state_folder() / "crashes", lambda: window.config.model_dump(mode="json"))
    watch.install()
    side_work = SideWork(window, state_folder(), watch)
    settings = SettingsDesk(window, file, maker.perceive_again)
    if not until_first_frame:
        panels = window.panels
        switches = overlay_switches(panels.overlay_bar)
        LayoutKeeper(window, "operator", Parts({"main": panels.columns}, {"right": panels.pages}, switches))
    rigs = RigDesk(window)

    def stop() -> None:  # whoever has the servos, or is about to
        window.stop_opening()
        window.stop_lent()

    devices = OperatorDevices(config, lambda: window.pilot, window, stop)
    devices.said.connect(window.say)
    application.aboutToQuit.connect(settings.close)
    application.aboutToQuit.connect(rigs.close)
    application.aboutToQuit.connect(devices.close)
    application.aboutToQuit.connect(side_work.close)
    timers: list[QTimer] = []

    def begin() -> None:
        devices.start()
        side_work.start()
        settings.start()
        if until_first_frame:
            timers.append(_leave_after_first_frame(window))
        else:
            tour_at_start(window, asked=tour)

    try:
        code = run_until_closed(application, window, window.say, begin)
    finally:
        maker.close()
    watch.remove()
    return code


def _leave_after_first_frame(window: OperatorWindow) -> QTimer:
    """For ``benchmark``: say when the first understood frame was on screen, and close."""
    from PySide6.QtCore import QTimer

    timer = QTimer(window)

    def look() -> None:
        tick = window.shown_tick
        if tick is not None and tick.scene.refusal is not None and tick.scene.refusal.reason is Reason.NO_MODEL:
            timer.stop()
            sys.stderr.write(f"error: {tick.scene.refusal}\n")
            window.close()
        elif tick is not None and tick.scene.path is not None:
            timer.stop()
            window.repaint()
            sys.stdout.write(json.dumps({"first_frame_monotonic_s": time.monotonic()}) + "\n")
            window.close()

    timer.timeout.connect(look)
    timer.start(5)
    return timer

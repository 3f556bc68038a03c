"""Opens the operator window on a rig. Imports that are slow to load come after the child processes have been started."""

from __future__ import annotations

import gc
import json
import logging
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from app.commands.options import with_outputs
from app.ui.display import check_display
from core.config.files import SettingsFile, settings_of_windows
from core.config.models import Config
from core.devices import UserError
from core.perception import compiled
from core.types import Reason
from hardware.rig import RigKind, rig_config, start_ahead
from hardware.twin.phantom import PHANTOM_TITLES

if TYPE_CHECKING:
    from app.operator.rig_engine import EngineMaker
    from app.operator.window import OperatorWindow
    from core.session.live_output import LiveOutput, OutputKind
    from hardware.twin.process import PrestartedProcesses


def finish_loading() -> None:
    """Load what a window needs before it is made, and keep it out of later garbage collections.

    Loading holds the interpreter's lock: beside the window it would block that for a quarter of a second.
    """
    compiled.load()
    gc.freeze()


def make_window(config: Config, kind: RigKind, maker: EngineMaker | None = None) -> OperatorWindow:
    """The window, not shown yet. There must be an application."""
    from app.operator.rig_engine import EngineMaker
    from app.operator.window import OperatorWindow
    from hardware.twin.own_phantom import own_phantoms

    own = own_phantoms(config.twin.phantom, config.perception.bench)
    return OperatorWindow(config, maker or EngineMaker(), kind, [*PHANTOM_TITLES.items(), *own])


def run_window(
    rig: str | None,
    config_path: Path | None,
    source: Path | None,
    *,
    stream: int | None = None,
    lsl: bool = False,
    until_first_frame: bool = False,
    tour: bool = False,
    bench: str | None = None,
) -> int:
    """Show the window until it is closed; returns the exit code. Raises UserError for what is wrong before it opens."""
    check_display()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    file = settings_of_windows(config_path)
    is_own = config_path is None and not until_first_frame  # a measurement does not depend on the user's settings
    config, kind = rig_config(rig, config_path, source, file.data if is_own else None)
    config = with_outputs(config, stream, lsl=lsl)
    if bench is not None and kind is not RigKind.SIM:
        raise UserError("--bench is for the twin: leave --rig and --source out")
    outputs = _open_outputs(config, is_asked=stream is not None or lsl)
    with ExitStack() as at_end:
        gc.disable()  # collections would be a fifth of the time that loading takes from here on
        at_end.callback(gc.enable)
        ahead = start_ahead(config)  # before all that is slow to load here; it is told the configuration later
        if ahead is not None:
            at_end.callback(ahead.end)  # what a rig has claimed goes on

        from app.operator.twin_menu import with_kept_twin
        from hardware.twin.own_phantom import with_own_phantom

        if is_own and kind is RigKind.SIM and "twin" not in file.data:
            config = with_kept_twin(config)
        if bench is not None:
            config = with_own_phantom(config, bench)
        return _show_window(config, kind, file, outputs, ahead, until_first_frame=until_first_frame, tour=tour)


def _show_window(
    config: Config,
    kind: RigKind,
    file: SettingsFile,
    outputs: dict[OutputKind, LiveOutput],
    ahead: PrestartedProcesses | None,
    *,
    until_first_frame: bool,
    tour: bool,
) -> int:
    from app.operator.live_menu import LiveMenuController
    from app.operator.manual_drive import OperatorDevices
    from app.operator.rehearsing import RehearsalController
    from app.operator.rig_engine import EngineMaker
    from app.operator.rig_menu import RigMenuController
    from app.operator.services import WindowServices, tour_at_start
    from app.operator.triggers import TriggerServer
    from app.settings.apply import SettingsController
    from app.ui.actions import MenuEntry, add_menu
    from app.ui.crash_report import CrashWatch, state_folder
    from app.ui.i18n import tr
    from app.ui.window_base import make_application, run_until_closed

    maker = EngineMaker(ahead)
    maker.begin_twin(config)
    maker.begin_network(config)
    finish_loading()
    application = make_application(config.window)
    window = make_window(config, kind, maker)
    watch = CrashWatch(state_folder() / "crashes", lambda: window.rig.config.model_dump(mode="json"))
    watch.install()
    services = WindowServices(window, state_folder(), watch)
    settings = SettingsController(window, file, maker.perceive_again)
    if not until_first_frame:
        _keep_layout(window)
    rehearsal = RehearsalController(window)
    services.preflight.sources.append(lambda: rehearsal.finding)
    rigs, live, triggers = RigMenuController(window), LiveMenuController(window, outputs), TriggerServer(window)
    devices = OperatorDevices(config, lambda: window.rig.pilot, window.rig.stop, window)
    devices.said.connect(window.say)
    add_menu(window, tr("&Session"), [MenuEntry(tr("&Triggers from other programs..."), triggers.describe)])
    for close in (rehearsal.close, settings.close, rigs.close, live.close, devices.close, triggers.close, services.close):
        application.aboutToQuit.connect(close)

    def begin() -> None:
        devices.start()
        services.start()
        settings.start()
        if until_first_frame:
            _leave_after_first_frame(window)
        else:
            triggers.listen()
            tour_at_start(window, asked=tour)

    code = run_until_closed(application, window, window.say, begin)
    watch.remove()
    return code


def _open_outputs(config: Config, *, is_asked: bool) -> dict[OutputKind, LiveOutput]:
    """Those of the configuration; what the command line asks for is there then, or a UserError."""
    if not (config.stream.foxglove or config.stream.lsl):
        return {}
    from core.session.live_output import open_outputs

    outputs = open_outputs(config.stream)
    for output in outputs.values() if is_asked else ():
        output.wait_open()
    return outputs


def _keep_layout(window: OperatorWindow) -> None:
    from app.ui.layout_state import LayoutState
    from app.widgets.scene_panels import overlay_actions

    switches = {**overlay_actions(window), "performance": window.performance_entry}
    LayoutState(window, "operator", window.panels.columns, window.panels.pages, switches)


def _leave_after_first_frame(window: OperatorWindow) -> None:
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

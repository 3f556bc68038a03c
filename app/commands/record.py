"""``record``: a session without a window."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.options import (
    ConditionOption,
    ConfigOption,
    JsonOption,
    LslOption,
    NotesOption,
    OperatorOption,
    PhantomOption,
    RigOption,
    StreamOption,
    TagOption,
    TaskOption,
    with_outputs,
)
from app.commands.progress import Interrupt, progress_bar
from app.operator.rig_engine import EngineMaker
from core.config.models import Config, sessions_folder
from core.config.rig_file import as_calibrated
from core.config.safety import AtClose
from core.devices import DeviceError, EndOfStream
from core.perception.model_file import check_model
from core.perception.pipeline import configured_bench
from core.program import COMMAND, program_id
from core.session.files import check_parent
from core.session.live_output import LiveOutput, open_outputs
from core.session.manifest import SessionError, about_rig, changed_description, event_of_alert, remembered_description
from core.session.writer import SessionWriter
from hardware.rig import RigKind, rig_config

if TYPE_CHECKING:
    from app.operator.rig_engine import RigEngine

_STEP_S = 0.1
"""The engine is asked for a frame for so long before the time is looked at."""
_PICTURE_WITHIN_S = 15.0
"""Without a picture for so long the camera counts as lost."""
_GAP_S = 2.0
"""A slow machine may take so long from picture to picture; longer gaps are reported."""


def record(
    seconds: Annotated[float, typer.Option(min=0.1, max=86_400.0, help="length of the recording; Ctrl-C ends it sooner")],
    out: Annotated[Path | None, typer.Option(help="folder in which the session is made; default: the configured one")] = None,
    rig: RigOption = None,
    lossless: Annotated[bool, typer.Option("--lossless", help="keep every pixel as it is; a hundred times the size")] = False,
    stream: StreamOption = None,
    lsl: LslOption = False,
    operator: OperatorOption = None,
    task: TaskOption = None,
    condition: ConditionOption = None,
    phantom: PhantomOption = None,
    notes: NotesOption = None,
    tag: TagOption = None,
    as_json: JsonOption = False,
    config_path: ConfigOption = None,
) -> None:
    """Record a session without a window. Operator, task, condition and phantom are remembered ones where they are not given."""
    # A camera that is lost meanwhile is waited for until the time is over; one that is still away then is an error.
    config, kind = rig_config(rig, config_path, None)
    settings = config.record.model_copy(update={"ring_s": 0.0} | ({"codec": "lossless"} if lossless else {}))
    config = with_outputs(config.model_copy(update={"record": settings}), stream, lsl=lsl)
    folder = out if out is not None else sessions_folder(settings.folder)
    check_parent(folder)
    # A window opens without a model or a bench and shows it; here it is refused.
    check_model(config.perception.segmentation.model)
    configured_bench(as_calibrated(config).perception)
    outputs = tuple(open_outputs(config.stream).values())
    for output in outputs:
        output.wait_open()
        sys.stderr.write(f"live output: {output.address}\n")
    engine = EngineMaker()(config)
    writer: SessionWriter | None = None
    try:
        about = about_rig(as_calibrated(config), kind.value, config.rig.name)
        program_id()  # asks git: no picture is to wait for it
        given = {"operator": operator, "task": task, "condition": condition, "phantom": phantom, "notes": notes, "tags": tag}
        about = replace(about, description=changed_description(remembered_description(), given))
        writer = SessionWriter(settings, about, folder=folder)
        for output in outputs:
            output.set_rig(about)
        done = _record(engine, writer, seconds, outputs)
        length_s = done.seconds
    finally:
        for output in outputs:
            output.end()
        try:
            is_whole = writer.close() if writer is not None else True
        finally:
            try:
                if kind is RigKind.LIVE:
                    leave_servos(engine, config.servos.at_close, print_line=lambda text: sys.stderr.write(f"{text}\n"))
            finally:
                engine.close()
    status = writer.status()
    kept = f"; what was written is in {status.folder}" if status.folder else ""
    if status.problem:
        raise SessionError(f"{status.problem}{kept}")
    if done.failed:
        raise DeviceError(f"{done.failed}{kept}")
    if status.folder is None:
        raise SessionError(f"nothing was recorded: {done.ended} before the first picture")
    if not is_whole:
        raise SessionError(f"{folder}: the disk does not answer; the session was not closed")
    result = {
        "session": str(status.folder),
        "ended": done.ended,
        "seconds": round(length_s, 3),
        "frames": status.frames,
        "dropped": status.dropped,
        "camera_dropped": done.camera_dropped,
        "camera_lost": done.camera_lost,
        "without_picture_s": round(done.without_picture_s, 3),
        "bytes": sum(path.stat().st_size for path in status.folder.iterdir()),
    }
    if as_json:
        sys.stdout.write(json.dumps(result) + "\n")
    else:
        _print(result, config)


_RELEASED_WITHIN_S = 20.0
"""Longer than letting the wires go slowly, and proving that the torque is off, take."""
_KEYS: dict[str, AtClose] = {"": "hold", "h": "hold", "r": "relax", "o": "torque off"}


def leave_servos(engine: RigEngine, how: AtClose, print_line: Callable[[str], object]) -> None:
    """What becomes of servos that hold: asked in a terminal where the rig says "ask"; without one they hold, and are watched."""
    pilot, status = engine.pilot, engine.bus_status()
    if pilot is None or status is None or not status.pulls:
        return
    if how == "ask":
        how = _ask_in_terminal(print_line) if sys.stdin is not None and sys.stdin.isatty() else "hold"
    if how == "hold":
        return
    print_line("the wires are let out, then the torque goes off" if how == "relax" else "the torque goes off")
    if not (pilot.relax() if how == "relax" else pilot.torque_off()):
        print_line("the servos are busy: they hold")
        return
    until_s = time.monotonic() + _RELEASED_WITHIN_S
    with Interrupt() as interrupt:
        while time.monotonic() < until_s and not interrupt.asked:
            if (status := engine.bus_status()) is None or not status.pulls:
                return
            pilot.window_alive()
            time.sleep(_STEP_S)
    print_line("the torque is not proven to be off: cut the servos' power")


def _ask_in_terminal(print_line: Callable[[str], object]) -> AtClose:
    """What the person at the terminal wants; Enter, Ctrl-C and its end mean "hold"."""
    while True:
        print_line("The servos hold the wires: h = hold (watched, then relaxed), r = relax slowly, o = torque off at once [h]")
        try:
            answer = input().strip().lower()[:1]
        except (EOFError, KeyboardInterrupt):
            return "hold"
        if answer in _KEYS:
            return _KEYS[answer]


@dataclass(slots=True)
class _RecordProgress:
    """Since the first frame: why it ended, why it failed, and the frames and time that the camera lost."""

    started_s: float | None = None
    ended: str = "all recorded"
    failed: str = ""
    camera_dropped: int = 0
    camera_lost: int = 0
    without_picture_s: float = 0.0
    picture_s: float = 0.0
    """Time of the last picture."""
    lost_until: int | None = None
    """The camera's count of lost frames at the last picture."""

    @property
    def seconds(self) -> float:
        return 0.0 if self.started_s is None else time.monotonic() - self.started_s

    def count_gap(self) -> None:
        """Count the time since the last picture if it was long."""
        if (away_s := time.monotonic() - self.picture_s) > _GAP_S:
            self.without_picture_s += away_s
        self.picture_s = time.monotonic()

    def count_lost(self, lost: int) -> None:
        """Count what was lost since the last picture; a camera that was opened again counts from 0."""
        if self.lost_until is not None:
            self.camera_lost += max(0, lost - self.lost_until)
        self.lost_until = lost


def _record(engine: RigEngine, writer: SessionWriter, seconds: float, outputs: Sequence[LiveOutput]) -> _RecordProgress:
    done = _RecordProgress()
    try:
        _record_into(engine, writer, outputs, seconds, done)
    except DeviceError as error:
        done.ended = done.failed = str(error)
    away_s = time.monotonic() - done.picture_s
    if not done.failed and done.started_s is not None and (engine.problem or away_s > _PICTURE_WITHIN_S):
        done.ended = done.failed = engine.problem or f"no picture from the camera for {away_s:.0f} s; check its cable"
    if done.started_s is not None:
        done.count_gap()
    writer.stop(done.ended)
    return done


def _record_into(
    engine: RigEngine, writer: SessionWriter, outputs: Sequence[LiveOutput], seconds: float, done: _RecordProgress
) -> None:
    receivers: tuple[SessionWriter | LiveOutput, ...] = (writer, *outputs)
    began_s = time.monotonic()
    is_warm, dropped_before = False, 0
    writer.start()
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("seconds recorded", total=round(seconds))
        while done.seconds < seconds:
            if interrupt.asked:
                done.ended = "interrupted"
                break
            try:
                tick = engine.step(_STEP_S)
            except EndOfStream as error:
                done.ended = str(error)
                break
            pilot = engine.pilot
            if pilot is not None:
                pilot.window_alive()  # the pilot stops a robot whose window hangs; no window here
                news = pilot.news()
                for receiver in receivers:
                    for view in news.changes:
                        receiver.drive(view)
                    for alert in news.alerts:
                        receiver.add_event(event_of_alert(alert, news.view.time_s))
            if tick is None:
                if done.started_s is None and time.monotonic() - began_s > _PICTURE_WITHIN_S:
                    no_picture = f"no picture from the camera for {_PICTURE_WITHIN_S:.0f} s; check its cable"
                    raise DeviceError(engine.problem or no_picture)
                if done.started_s is not None and engine.problem:
                    bar.update(task, completed=int(done.seconds), description=f"seconds, no picture: {engine.problem}")
                continue
            if not is_warm:
                is_warm = True  # the first tick waited seconds for the network to warm up
                continue
            if done.started_s is None:
                done.started_s = done.picture_s = time.monotonic()
                dropped_before = tick.dropped_frames
            done.count_gap()
            done.count_lost(tick.frame.lost)
            done.camera_dropped = tick.dropped_frames - dropped_before
            for receiver in receivers:
                receiver.put(tick, pilot.view if pilot is not None else None, engine.bus_status())
            status = writer.status()
            if status.problem:
                break
            bar.update(
                task, completed=int(done.seconds), description=f"seconds, {status.bytes / 1e6:.1f} MB, {status.dropped} dropped"
            )


def _print(result: dict[str, Any], config: Config) -> None:
    sys.stdout.write(f"{result['session']}\n")
    minutes = max(result["seconds"], 1e-3) / 60.0
    if result["without_picture_s"]:
        sys.stderr.write(f"for {result['without_picture_s']:.1f} s of it the camera sent no picture\n")
    sys.stderr.write(
        f"{result['ended']}: {result['seconds']:.1f} s, {result['frames']} frames, {result['dropped']} dropped by the recorder, "
        f"{result['camera_dropped']} skipped for newer ones, {result['camera_lost']} lost by the camera, "
        f"{result['bytes'] / 1e6:.1f} MB "
        f"({result['bytes'] / 1e6 / minutes:.1f} MB a minute, {config.record.codec})\n"
        f"next: {COMMAND} play {result['session']}, or annotate it\n"
    )

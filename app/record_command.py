"""``record``: a session without a window."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.learning_commands import Interrupt, progress_bar
from app.rig_engine import EngineMaker
from app.window_command import window_config
from core.config import Config
from core.devices import DeviceError, EndOfStream
from core.learning.model_file import check_model
from core.record_config import sessions_folder
from core.session.events import event_of_alert
from core.session.files import check_parent
from core.session.manifest import SessionError, about_rig
from core.session.writer import SessionWriter
from core.types import Tick

if TYPE_CHECKING:
    from app.rig_engine import RigEngine

_STEP_S = 0.1
_FIRST_FRAME_WITHIN_S = 15.0


@dataclass(slots=True)
class _Progress:
    """Since the first frame."""

    started_s: float | None = None
    ended: str = "all recorded"
    camera_dropped: int = 0

    @property
    def seconds(self) -> float:
        return 0.0 if self.started_s is None else time.monotonic() - self.started_s


def run_record(
    seconds: float, out: Path | None, *, rig: str | None, config_path: Path | None, lossless: bool, as_json: bool
) -> None:
    """Record so many seconds into a new session in `out`; raises SessionError, DeviceError, ConfigError, ModelError."""
    config, kind = window_config(rig, config_path, None)
    settings = config.record.model_copy(update={"ring_s": 0.0} | ({"codec": "lossless"} if lossless else {}))
    config = config.model_copy(update={"record": settings})
    folder = out if out is not None else sessions_folder(settings.folder)
    check_parent(folder)
    check_model(config.perception.segmentation.model)  # the window goes on without a pose and says so; here nobody would see it
    engine = EngineMaker()(config)
    writer: SessionWriter | None = None
    try:
        writer = SessionWriter(settings, about_rig(config, kind.value, config.rig.name), folder=folder)
        done = _record(engine, writer, seconds)
        length_s = done.seconds
    finally:
        try:
            is_whole = writer.close() if writer is not None else True
        finally:
            engine.close()
    status = writer.status()
    if status.problem:
        kept = f"; what was written is in {status.folder}" if status.folder else ""
        raise SessionError(f"{status.problem}{kept}")
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
        "bytes": _size(status.folder),
    }
    _tell(result, config, as_json)


def _record(engine: RigEngine, writer: SessionWriter, seconds: float) -> _Progress:
    done = _Progress()
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
            _tell_driving(engine, writer)
            if tick is None:
                if done.started_s is None and time.monotonic() - began_s > _FIRST_FRAME_WITHIN_S:
                    raise DeviceError(f"no picture from the camera for {_FIRST_FRAME_WITHIN_S:.0f} s; check its cable")
                continue
            if not is_warm:
                # The first one waited for the network to warm up: it is seconds old when it is understood.
                is_warm = True
                continue
            if done.started_s is None:
                done.started_s, dropped_before = time.monotonic(), tick.dropped_frames
            done.camera_dropped = tick.dropped_frames - dropped_before
            _put(engine, writer, tick)
            status = writer.status()
            if status.problem:
                break
            bar.update(
                task, completed=int(done.seconds), description=f"seconds, {status.bytes / 1e6:.1f} MB, {status.dropped} dropped"
            )
    writer.stop(done.ended)
    return done


def _put(engine: RigEngine, writer: SessionWriter, tick: Tick) -> None:
    """The tick with all that is known of driving."""
    pilot = engine.pilot
    writer.put(tick, pilot.view if pilot is not None else None, engine.bus_status())


def _tell_driving(engine: RigEngine, writer: SessionWriter) -> None:
    """What happened since the last turn, also when there was no picture. There is no window, which must not pass for a hung one."""
    if (pilot := engine.pilot) is None:
        return
    pilot.window_alive()
    news = pilot.news()
    for view in news.changes:
        writer.drive(view)
    for alert in news.alerts:
        writer.add_event(event_of_alert(alert, news.view.time_s))


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir())


def _tell(result: dict[str, Any], config: Config, as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(result) + "\n")
        return
    sys.stdout.write(f"{result['session']}\n")
    minutes = max(result["seconds"], 1e-3) / 60.0
    sys.stderr.write(
        f"{result['ended']}: {result['seconds']:.1f} s, {result['frames']} frames, {result['dropped']} dropped by the recorder, "
        f"{result['camera_dropped']} by camera and perception, {result['bytes'] / 1e6:.1f} MB "
        f"({result['bytes'] / 1e6 / minutes:.1f} MB a minute, {config.record.codec})\n"
    )

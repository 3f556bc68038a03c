"""``session info``, ``session recover`` and ``session export``.

``record``: a session without a window.

``play``: opens the player on a session.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from app.commands.progress import Interrupt, progress_bar
from app.operator.rig_engine import EngineMaker
from core.config.files import own_config
from core.config.models import Config, sessions_folder
from core.config.rig_file import as_calibrated
from core.control.modes import Mode
from core.devices import DeviceError, EndOfStream, UserError
from core.perception import compiled
from core.perception.model_file import check_model
from core.session.export import export_csv, export_mp4
from core.session.files import check_parent, is_being_written
from core.session.manifest import Manifest, SessionError, about_rig, event_of_alert, frames_lost
from core.session.reader import SessionReader, losses, rows_cut_off
from core.session.recovery import expected_loss, payload_bytes, recover
from core.session.writer import SessionWriter
from core.types import Image, PoseState, Tick
from hardware.rig import rig_config

if TYPE_CHECKING:
    from app.operator.rig_engine import RigEngine


_ENDINGS = (".mp4", ".csv", ".mcap")


def run_info(folder: Path, *, as_json: bool) -> None:
    """Say what a session is. Raises SessionError."""
    with SessionReader(folder) as reader:
        reader.wait()
        result, is_cut = describe(reader), _is_cut(reader)
    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
        return
    table = Table(title=str(folder), show_header=False)
    for key, value in result.items():
        table.add_row(key, _words(value))
    Console(markup=False, emoji=False).print(table)
    if is_cut:
        sys.stderr.write(f"note: it did not end properly; repair it with: session recover {folder}\n")


def _is_cut(reader: SessionReader) -> bool:
    """Whether it did not end properly, and nobody has repaired it."""
    return not (reader.manifest is not None and reader.manifest.closed) and not is_being_written(reader.folder)


def _words(value: Any) -> str:
    if isinstance(value, list):
        return "\n".join(value) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{name} {count}" for name, count in value.items()) or "none"
    return "-" if value is None else str(value)


def describe(reader: SessionReader) -> dict[str, Any]:
    """What ``session info --json`` prints."""
    manifest, line, events = reader.manifest, reader.timeline(), reader.events
    counts = manifest.counts if manifest else None
    loss = manifest.recovered if manifest else None
    ended = "cut" if _is_cut(reader) else "being recorded"
    if loss is not None:
        ended = "recovered"
    kinds: dict[str, int] = {}
    for event in events:
        kinds[event.kind.value] = kinds.get(event.kind.value, 0) + 1
    return {
        "session": str(reader.folder),
        "kind": manifest.kind if manifest else None,
        "rig": manifest.rig if manifest else None,
        "started_utc": manifest.started_utc.isoformat() if manifest else None,
        "ended": (manifest.ended or "closed") if manifest and manifest.closed and loss is None else ended,
        "recovered": f"{loss.seconds} s, {loss.rows} rows and {loss.pictures} pictures lost" if loss else None,
        "seconds": round(reader.duration_s, 3),
        "rows": len(reader),
        "missing_rows": reader.missing_rows + rows_cut_off(reader),
        "dropped": counts.dropped if counts and manifest and manifest.closed else None,
        "camera_lost": frames_lost(events),
        "states": {state.value: int((line.state == place).sum()) for place, state in enumerate(PoseState)},
        "without_pose": int((line.state < 0).sum()),
        "theta_median_deg": round(float(np.nanmedian(np.abs(line.theta_deg))), 3) if np.isfinite(line.theta_deg).any() else None,
        "modes": {mode.value: int((line.mode == place).sum()) for place, mode in enumerate(Mode) if (line.mode == place).any()},
        "events": kinds,
        "videos": [path.name for path in reader.videos],
        "codec": manifest.codec if manifest else None,
        "model": manifest.model.get("name") if manifest else None,
        "bytes": sum(path.stat().st_size for path in reader.folder.iterdir() if path.is_file()),
        "problems": [*reader.problems, *losses(reader, events)],
    }


def run_recover(folder: Path, into: Path | None, *, as_json: bool, only_look: bool = False) -> None:
    """Repair a session into a copy, or with `only_look` only tell what would be lost. Raises SessionError."""
    with progress_bar() as bar:
        task = bar.add_task("bytes read", total=payload_bytes(folder))

        def on_bytes(count: int) -> None:
            bar.advance(task, count)

        done = expected_loss(folder, on_bytes) if only_look else recover(folder, into, on_bytes)
    if as_json:
        result = {"session": str(done.folder), "frames": done.frames, "pictures": done.pictures}
        loss = {"seconds": done.loss.seconds, "rows": done.loss.rows, "pictures": done.loss.pictures}
        sys.stdout.write(json.dumps(result | {"lost": loss, "problems": list(done.loss.problems)}) + "\n")
        return
    sys.stdout.write(f"{done.folder}\n")
    for problem in done.loss.problems:
        sys.stderr.write(f"note: {problem}\n")
    sys.stderr.write(
        f"{done.frames} rows and {done.pictures} pictures {'can be ' * only_look}recovered; lost: {done.loss.seconds:.2f} s "
        f"({done.loss.rows} rows, {done.loss.pictures} pictures)\n"
    )


def run_export(folder: Path, outs: list[Path], *, plain: bool, as_json: bool) -> None:
    """Write each of `outs`, whose ending names the format. Raises SessionError."""
    for out in outs:
        if out.suffix.lower() not in _ENDINGS:
            raise SessionError(f"{out}: unknown format; the file's ending must be one of {', '.join(_ENDINGS)}")
    written: dict[str, int] = {}
    with SessionReader(folder) as reader:
        reader.wait()
        with progress_bar() as bar:
            for out in outs:
                task = bar.add_task(out.name, total=len(reader))
                written[str(out)] = _export(reader, out, plain, lambda task=task: bar.advance(task))
        lost = losses(reader, reader.events)  # what is wrong with the events is found here
        problems = [*reader.problems, *lost]
        if _is_cut(reader):
            problems.append(f"it did not end properly: session recover {folder} saves what can be had")
        elif is_being_written(folder):
            problems.append("it is still being recorded: what came later is not in what was written")
    if as_json:
        sys.stdout.write(json.dumps({"written": written, "problems": problems}) + "\n")
        return
    for problem in problems:
        sys.stderr.write(f"note: {problem}\n")
    for name, count in written.items():
        sys.stdout.write(f"{name}: {count} {_unit(Path(name))}\n")


def _unit(path: Path) -> str:
    return {".mp4": "pictures", ".csv": "rows"}.get(path.suffix.lower(), "messages")


def _export(reader: SessionReader, out: Path, plain: bool, on_row: Any) -> int:
    match out.suffix.lower():
        case ".csv":
            return export_csv(reader, out, on_row)
        case ".mcap":
            from core.session.export import export_mcap

            return export_mcap(reader, out, on_row)
        case _:
            kind = reader.manifest.kind if reader.manifest else "UNKNOWN"
            return export_mp4(reader, out, None if plain else _overlay(kind), on_row=on_row)


def _overlay(kind: str) -> Any:
    """Burns in what was understood, with the banner's word, so that a simulation is never taken for a real run."""
    from app.widgets.overlay_image import draw_overlay

    def draw(tick: Tick) -> Image:
        return draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=f"{kind} PLAYBACK")

    return draw


_STEP_S = 0.1
_PICTURE_WITHIN_S = 15.0
_GAP_S = 2.0
"""A slow machine may take so long from picture to picture; what is longer is told."""


@dataclass(slots=True)
class _Progress:
    """Since the first frame."""

    started_s: float | None = None
    ended: str = "all recorded"
    failed: str = ""
    """Why it ended too early, or without the camera."""
    camera_dropped: int = 0
    camera_lost: int = 0
    """Frames that never came from the camera."""
    without_picture_s: float = 0.0
    picture_s: float = 0.0
    """When the last one was understood."""
    lost_until: int | None = None
    """What the camera had lost until then, since it was opened."""

    @property
    def seconds(self) -> float:
        return 0.0 if self.started_s is None else time.monotonic() - self.started_s

    def see_gap(self) -> None:
        """Count the time since the last picture if it was long."""
        if (away_s := time.monotonic() - self.picture_s) > _GAP_S:
            self.without_picture_s += away_s
        self.picture_s = time.monotonic()

    def see_lost(self, lost: int) -> None:
        """Count what was lost since the last picture; a camera that was opened again counts from 0."""
        if self.lost_until is not None:
            self.camera_lost += max(0, lost - self.lost_until)
        self.lost_until = lost


def run_record(
    seconds: float, out: Path | None, *, rig: str | None, config_path: Path | None, lossless: bool, as_json: bool
) -> None:
    """Record so many seconds into a new session in `out`; raises SessionError, DeviceError, ConfigError, ModelError.

    A camera that is lost meanwhile is waited for until the time is over, and how long it was away is told; one that is still away
    then is an error, as every failure is, which names what was recorded.
    """
    config, kind = rig_config(rig, config_path, None)
    settings = config.record.model_copy(update={"ring_s": 0.0} | ({"codec": "lossless"} if lossless else {}))
    config = config.model_copy(update={"record": settings})
    folder = out if out is not None else sessions_folder(settings.folder)
    check_parent(folder)
    check_model(config.perception.segmentation.model)  # the window goes on without a pose and says so; here nobody would see it
    engine = EngineMaker()(config)
    writer: SessionWriter | None = None
    try:
        writer = SessionWriter(settings, about_rig(as_calibrated(config), kind.value, config.rig.name), folder=folder)
        done = _record(engine, writer, seconds)
        length_s = done.seconds
    finally:
        try:
            is_whole = writer.close() if writer is not None else True
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
        "bytes": _size(status.folder),
    }
    _tell(result, config, as_json)


def _record(engine: RigEngine, writer: SessionWriter, seconds: float) -> _Progress:
    done = _Progress()
    try:
        _record_into(engine, writer, seconds, done)
    except DeviceError as error:
        done.ended = done.failed = str(error)
    away_s = time.monotonic() - done.picture_s
    if not done.failed and done.started_s is not None and (engine.problem or away_s > _PICTURE_WITHIN_S):
        done.ended = done.failed = engine.problem or f"no picture from the camera for {away_s:.0f} s; check its cable"
    if done.started_s is not None:
        done.see_gap()
    writer.stop(done.ended)
    return done


def _record_into(engine: RigEngine, writer: SessionWriter, seconds: float, done: _Progress) -> None:
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
                if done.started_s is None and time.monotonic() - began_s > _PICTURE_WITHIN_S:
                    no_picture = f"no picture from the camera for {_PICTURE_WITHIN_S:.0f} s; check its cable"
                    raise DeviceError(engine.problem or no_picture)
                if done.started_s is not None and engine.problem:
                    bar.update(task, completed=int(done.seconds), description=f"seconds, no picture: {engine.problem}")
                continue
            if not is_warm:
                # The first one waited for the network to warm up: it is seconds old when it is understood.
                is_warm = True
                continue
            if done.started_s is None:
                done.started_s = done.picture_s = time.monotonic()
                dropped_before = tick.dropped_frames
            done.see_gap()
            done.see_lost(tick.frame.lost)
            done.camera_dropped = tick.dropped_frames - dropped_before
            _put(engine, writer, tick)
            status = writer.status()
            if status.problem:
                break
            bar.update(
                task, completed=int(done.seconds), description=f"seconds, {status.bytes / 1e6:.1f} MB, {status.dropped} dropped"
            )


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
    if result["without_picture_s"]:
        sys.stderr.write(f"for {result['without_picture_s']:.1f} s of it the camera sent no picture\n")
    sys.stderr.write(
        f"{result['ended']}: {result['seconds']:.1f} s, {result['frames']} frames, {result['dropped']} dropped by the recorder, "
        f"{result['camera_dropped']} skipped for newer ones, {result['camera_lost']} lost by the camera, "
        f"{result['bytes'] / 1e6:.1f} MB "
        f"({result['bytes'] / 1e6 / minutes:.1f} MB a minute, {config.record.codec})\n"
    )


def run_play(session: Path, against: Path | None = None) -> int:
    """Show the player until it is closed; returns the exit code. Raises SessionError for what is no session, UserError."""
    from app.ui.window_base import check_display, make_application, run_until_closed

    check_display()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    if against is not None and not against.is_file():
        raise UserError(f"{against}: no such file; write one with: replay SESSION --jsonl FILE")
    reader = SessionReader(session)
    try:
        config = recorded_config(reader.manifest)
        compiled.load()  # drawing uses them, and may not wait
        application = make_application(own_config().window)

        from app.player.window import PlayerWindow
        from app.ui.layout_state import LayoutState, Parts, overlay_switches
        from app.widgets.scene_overlay import Layer

        window = PlayerWindow(reader, config, against)
        panels = window.panels
        switches = overlay_switches(panels.overlay_bar, without=(Layer.LOUPE,) if against is not None else ())
        LayoutState(window, "player", Parts({"main": panels.columns}, {"right": panels.pages}, switches))
        return run_until_closed(application, window, window.show_message)
    finally:
        reader.close()


def recorded_config(manifest: Manifest | None) -> Config:
    """The user's own configuration, with the limits and the scale of the recording where its manifest tells them."""
    own = own_config()
    recorded = manifest.config if manifest is not None else {}
    try:
        told = Config.model_validate({key: recorded[key] for key in ("perception", "policy") if key in recorded})
    except ValidationError:  # of another version; its limits are only lines on the dials
        return own
    return own.model_copy(update={"perception": told.perception, "policy": told.policy})

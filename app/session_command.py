"""``session info``, ``session recover`` and ``session export``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from app.long_work import progress_bar
from core.control.modes import Mode
from core.session.completeness import losses, rows_cut_off
from core.session.events import frames_lost
from core.session.export import export_csv, export_mp4
from core.session.files import is_being_written
from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.session.recovery import expected_loss, payload_bytes, recover
from core.types import Image, PoseState, Tick

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
            from core.session.mcap_export import export_mcap

            return export_mcap(reader, out, on_row)
        case _:
            kind = reader.manifest.kind if reader.manifest else "UNKNOWN"
            return export_mp4(reader, out, None if plain else _overlay(kind), on_row=on_row)


def _overlay(kind: str) -> Any:
    """Burns in what was understood, with the banner's word, so that a simulation is never taken for a real run."""
    from app.overlay_picture import draw_overlay

    def draw(tick: Tick) -> Image:
        return draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=f"{kind} PLAYBACK")

    return draw

"""Snapshots: the raw picture, the picture with overlays, and the values, written away from the GUI thread."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from itertools import count
from pathlib import Path

import cv2
import platformdirs
from PySide6.QtCore import QObject, Signal

from app.ui.i18n import mark, tr
from app.ui.workers import Worker
from app.widgets.overlay_image import draw_overlay
from core.devices import UserError
from core.session.codec import scene_to_json
from core.types import Image, Tick

_FINISH_WITHIN_MS = 5_000


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a picture comes from: what the banner says of the rig, the phantom if there is one, and the network."""

    rig: str
    phantom: str | None = None
    model: str | None = None


def pictures_folder(configured: str | None) -> Path:
    """Where snapshots go: the configured folder, else LumenPilot in the user's pictures."""
    return Path(configured).expanduser() if configured else Path(platformdirs.user_pictures_dir()) / "LumenPilot"


def write_snapshot(folder: Path, tick: Tick, origin: Origin, now: datetime) -> Path:
    """Write ``<time>.png``, ``<time>_overlay.png`` and ``<time>.json``; returns the first path. Raises OSError.

    What is there already stays: the later one of the same millisecond is called ``<time>_2``.
    The JSON object is that of one image, with ``rig``, ``phantom``, ``model``, ``frame`` (index since the rig's start) and
    ``captured_s`` (seconds of the camera's clock) added.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = _free_name(folder, f"{now:%Y-%m-%d_%H-%M-%S}_{now.microsecond // 1000:03d}")
    first = folder / f"{name}.png"
    _write_new(first, _png(tick.frame.image))
    overlay = draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=origin.rig)
    _write_new(folder / f"{name}_overlay.png", _png(overlay))
    record = scene_to_json(first.name, tick.scene) | {
        "rig": origin.rig,
        "phantom": origin.phantom,
        "model": origin.model,
        "frame": tick.frame.index,
        "captured_s": round(tick.frame.captured_s, 6),
    }
    _write_new(folder / f"{name}.json", (json.dumps(record, indent=1, allow_nan=False) + "\n").encode())
    return first


def _free_name(folder: Path, name: str) -> str:
    """The name, or the first one numbered after it, of which none of the three files is there."""
    names = (name if k == 1 else f"{name}_{k}" for k in count(1))
    return next(free for free in names if not any((folder / f"{free}{end}").exists() for end in (".png", "_overlay.png", ".json")))


def _write_new(path: Path, data: bytes) -> None:
    """Raises OSError, also when one of that name was made meanwhile."""
    with path.open("xb") as file:
        file.write(data)


def _png(image: Image) -> bytes:
    done, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not done:
        raise OSError("the picture could not be encoded")
    return data.tobytes()


class SnapshotWriter(QObject):
    """Writes snapshots in a thread of its own. ``saved`` and ``failed`` carry the line to show."""

    saved = Signal(str)
    failed = Signal(str)

    def __init__(self, folder: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.folder = folder
        """Where the next ones go."""
        self._work = Worker("snapshots", self)
        self._work.done.connect(lambda _key, path: self.saved.emit(tr(_SAVED, path=path)))
        self._work.failed.connect(lambda _key, why: self.failed.emit(tr("Snapshot not saved: {why}", why=why)))

    def write(self, tick: Tick, origin: Origin) -> None:
        """Start to write; returns at once."""
        self._work.submit("snapshot", partial(_write, self.folder, tick, origin, datetime.now()))

    def finish(self, within_ms: int = _FINISH_WITHIN_MS) -> bool:
        """End after everything is on the disk; False when the disk has not answered in time."""
        self._work.stop(finish=True)
        return self._work.wait(within_ms)


_SAVED = mark("Snapshot saved: {path} (with _overlay.png and .json)")


def _write(folder: Path, tick: Tick, origin: Origin, now: datetime) -> Path:
    try:
        return write_snapshot(folder, tick, origin, now)
    except OSError as error:
        raise UserError(f"{error.filename or folder}: {error.strerror or error}") from error

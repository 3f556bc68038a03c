"""Snapshots: the raw picture, the picture with overlays, and the values, written away from the GUI thread."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path

import cv2
import platformdirs
from PySide6.QtCore import QObject, QRunnable, QThreadPool, Signal

from app.overlay_picture import draw_overlay
from app.scene_json import scene_to_json
from core.types import Image, Tick


def pictures_folder(configured: str | None) -> Path:
    """Where snapshots go: the configured folder, else LumenPilot in the user's pictures."""
    return Path(configured).expanduser() if configured else Path(platformdirs.user_pictures_dir()) / "LumenPilot"


def write_snapshot(folder: Path, tick: Tick, stamp: str, now: datetime) -> Path:
    """Write ``<time>.png``, ``<time>_overlay.png`` and ``<time>.json``; returns the first path. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{now:%Y-%m-%d_%H-%M-%S}_{now.microsecond // 1000:03d}"
    first = folder / f"{name}.png"
    first.write_bytes(_png(tick.frame.image))
    overlay = draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=stamp)
    (folder / f"{name}_overlay.png").write_bytes(_png(overlay))
    record = scene_to_json(first.name, tick.scene)
    (folder / f"{name}.json").write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return first


def _png(image: Image) -> bytes:
    done, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not done:
        raise OSError("the picture could not be encoded")
    return data.tobytes()


class SnapshotWriter(QObject):
    """Writes in a thread of its own. ``saved`` and ``failed`` carry the line to show."""

    saved = Signal(str)
    failed = Signal(str)

    def __init__(self, folder: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._folder = folder
        self._pool = QThreadPool(self)
        self._pool.setMaxThreadCount(1)

    @property
    def folder(self) -> Path:
        return self._folder

    def write(self, tick: Tick, stamp: str) -> None:
        """Start to write; returns at once."""
        self._pool.start(_Job(self, tick, stamp, datetime.now()))

    def finish(self) -> None:
        """Wait until everything is on the disk."""
        self._pool.waitForDone()


class _Job(QRunnable):
    def __init__(self, writer: SnapshotWriter, tick: Tick, stamp: str, now: datetime) -> None:
        super().__init__()
        self._writer = writer
        self._tick = tick
        self._stamp = stamp
        self._now = now

    def run(self) -> None:
        folder = self._writer.folder
        try:
            path = write_snapshot(folder, self._tick, self._stamp, self._now)
        except OSError as error:
            self._writer.failed.emit(f"Snapshot not saved: {error.filename or folder}: {error.strerror or error}")
        else:
            self._writer.saved.emit(f"Snapshot saved: {path} (with _overlay.png and .json)")

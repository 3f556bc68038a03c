"""A part of a session as a video with overlays, written by a thread of its own that can be told to stop."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject, QThread, Signal

from app.language import tr
from app.overlay_picture import draw_overlay
from core.errors import UserError
from core.names import name_of
from core.session.export import export_mp4
from core.session.reader import SessionReader
from core.types import Image, Tick

_REPORTS = 100
_LOOK_S = 0.05

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Clip:
    """Rows from `first` to `last` (not included) of a session, into a file that is not there yet. ``kind`` is burnt in."""

    session: Path
    out: Path
    first: int
    last: int
    kind: str


class _Stopped(UserError):
    """Told to stop."""


class ClipExporter(QThread):
    """One clip. It reads the session by itself, so that playing goes on beside it.

    ``progressed`` carries 0..1; ``ended`` a line to show and whether it went wrong.
    """

    progressed = Signal(object)
    ended = Signal(str, bool)

    def __init__(self, clip: Clip, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("clip")
        self._clip = clip
        self._stop = threading.Event()
        self._done = 0

    def cancel(self) -> None:
        """Stop soon; nothing is left of the file."""
        self._stop.set()

    def run(self) -> None:
        clip = self._clip
        try:
            with SessionReader(clip.session) as reader:
                while not reader.wait(_LOOK_S):
                    self._check()
                written = export_mp4(reader, clip.out, self._draw, first=clip.first, last=clip.last, on_row=self._on_row)
        except _Stopped:
            self.ended.emit(tr("Clip cancelled; nothing was kept"), False)
        except UserError as error:
            self.ended.emit(tr("Clip not saved: {why}", why=error), True)
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
            _log.error("the clip was not written", exc_info=error)
            self.ended.emit(
                tr("Clip not saved: unexpected {kind}: {why}", kind=type(error).__name__, why=" ".join(str(error).split())), True
            )
        else:
            lost = clip.last - clip.first - written
            note = tr(", {count} pictures are lost", count=lost) if lost > 0 else ""
            self.ended.emit(tr("Clip saved: {file} ({count} pictures{note})", file=clip.out, count=written, note=note), False)

    def _draw(self, tick: Tick) -> Image:
        return draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=f"{self._clip.kind} PLAYBACK")

    def _check(self) -> None:
        if self._stop.is_set():
            raise _Stopped("cancelled")

    def _on_row(self) -> None:
        self._check()
        self._done += 1
        count = max(1, self._clip.last - self._clip.first)
        if self._done % max(1, count // _REPORTS) == 0 or self._done == count:
            self.progressed.emit(self._done / count)


def clip_path(folder: Path, session: Path, first_s: float, last_s: float) -> Path:
    """A file name that tells what is in it and is not there yet."""
    name = f"{name_of(session)}_{round(first_s * 1000)}-{round(last_s * 1000)}ms"
    path, k = folder / f"{name}.mp4", 1
    while path.exists():
        k += 1
        path = folder / f"{name}_{k}.mp4"
    return path
